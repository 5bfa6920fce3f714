"""Agitation by held white noise: a Gaussian fluid velocity at every drag point, redrawn at fixed intervals."""

from __future__ import annotations

from typing import Any, ClassVar

from kinetics.support.settings import NotNegative, Positive
from mechsim.effects.base import Effect, FlowSource
from mechsim.effects.view import ViewOfScene, ViewOfWorld


class Agitation(Effect, tag="agitation"):
    """Agitation by fluid velocities N(0, sigma) per component and drag point (paper, eqs. 1-3), redrawn every `hold`.

    The paper redraws at every step, which has no limit as the step shrinks. Holding the velocity for a physical time
    makes the motion independent of the integrator's step. Cost: one normal random number per component, drag
    point and hold. Choose it to compare with the paper.

    sigma : standard deviation of a component, length / tu
    hold : time for which a draw is held, tu; a whole number of steps
    """

    provides: ClassVar[str | None] = "agitation"
    needs: ClassVar[tuple[str, ...]] = ("drag",)  # moving fluid reaches the cubes through drag alone
    example: ClassVar[dict[str, Any]] = {"sigma": 4.0, "hold": 0.0105}
    sigma: NotNegative
    hold: Positive

    @property
    def held_for(self) -> float | None:
        """The hold."""
        return self.hold

    def check(self, scene: ViewOfScene) -> None:
        """Check that the hold is a whole number of steps."""
        super().check(scene)
        steps = self.hold / scene.numerics.step
        if steps > 1e15:
            raise ValueError(f"agitation.hold = {self.hold} is {steps:.3g} steps; expected at most 1e15")
        if steps < 0.5 or abs(steps - round(steps)) > 1e-9 * steps:
            raise ValueError(
                f"agitation.hold = {self.hold} is not a whole number of steps of {scene.numerics.step}; "
                f"choose numerics.step = {self.hold / max(round(steps), 1):.9g}"
            )

    def attach(self, world: ViewOfWorld) -> FlowSource:
        """Give the fluid a random stream of its own."""
        return _Agitating(self, world)


class _Agitating(FlowSource):
    def __init__(self, settings: Agitation, world: ViewOfWorld):
        self.sigma, self.world = settings.sigma, world
        self.hold_steps = round(settings.hold / world.step_size)
        self.rng = world.stream("agitation")

    def before_step(self) -> None:
        if self.world.step_count % self.hold_steps == 0:
            self.rng.standard_normal(out=self.flow)
            self.flow *= self.sigma
