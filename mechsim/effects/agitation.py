"""Agitation of the fluid: an independent Gaussian velocity at every drag point, held for a physical time."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from mechsim.effects.base import Action, Effect

if TYPE_CHECKING:
    from mechsim.world import World


class Agitation(Effect):
    """Fluid velocity N(0, sigma) per component and drag point (paper, eqs. 1-3), redrawn every `hold`.

    The paper redraws at every step, which has no limit as the step shrinks. Holding the velocity for a physical
    time makes the
    motion independent of the integrator's step.

    sigma : standard deviation of a component, length / tu
    hold : time for which a draw is held, tu; a whole number of steps
    """

    effect: Literal["agitation"] = "agitation"
    needs: ClassVar[tuple[str, ...]] = ("drag",)  # moving fluid reaches the cubes through drag alone
    sigma: float = Field(ge=0)
    hold: float = Field(gt=0)

    def attach(self, world: World) -> Action:
        """Check that the hold is a whole number of steps."""
        steps = round(self.hold / world.step_size)
        if steps < 1 or abs(steps * world.step_size - self.hold) > 1e-9 * self.hold:
            raise ValueError(
                f"agitation.hold = {self.hold} is not a whole number of steps of {world.step_size}; "
                f"choose numerics.step = {self.hold / max(steps, 1):.9g}"
            )
        return _Agitating(self, world, steps)


class _Agitating(Action):
    def __init__(self, settings: Agitation, world: World, hold_steps: int):
        self.sigma, self.world, self.hold_steps = settings.sigma, world, hold_steps
        self.rng = world.stream("agitation")

    def before_step(self) -> None:
        if self.world.step_count % self.hold_steps == 0:
            fluid = self.world.fluid
            self.rng.standard_normal(out=fluid)
            fluid *= self.sigma
