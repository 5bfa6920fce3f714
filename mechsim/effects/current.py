"""Steady uniform flow that carries the cubes along."""

from __future__ import annotations

from typing import Any, ClassVar

from mechsim.effects.base import Effect, FlowSource
from mechsim.effects.view import ViewOfWorld


class Current(Effect, tag="current"):
    """A steady uniform flow, u = velocity at every drag point, added to all other flow of the fluid.

    In this flow alone, a free cube that starts at rest and does not turn is accelerated by quadratic drag (paper,
    eq. 4): its velocity relative to the fluid falls as 1 / (1 + Cd rho_fluid |u| t / (rho edge)), the semi-implicit
    drag at any step. The current passes through the walls of the tank, against which it carries the cubes.

    velocity : (x, y, z), length / tu
    """

    needs: ClassVar[tuple[str, ...]] = ("drag",)  # moving fluid reaches the cubes through drag alone
    example: ClassVar[dict[str, Any]] = {"velocity": [0.5, 0.0, 0.0]}
    velocity: tuple[float, float, float]

    def attach(self, world: ViewOfWorld) -> FlowSource:
        """Write the flow once; it stays."""
        return _Streaming(self, world)


class _Streaming(FlowSource):
    def __init__(self, settings: Current, world: ViewOfWorld):
        self.velocity, self.world = settings.velocity, world

    def before_step(self) -> None:
        if self.world.step_count == 0:
            self.flow[:] = self.velocity
