"""Steady linear flow: a fluid velocity with a constant gradient, such as simple shear."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from mechsim.effects.base import Effect, FlowSource
from mechsim.effects.view import ViewOfWorld

Row = tuple[float, float, float]


class Shear(Effect, tag="shear"):
    """A steady linear flow, u(x) = gradient (x - centre) at every drag point, added to all other flow of the fluid.

    A linear flow turns a fluid element at half its vorticity, curl u / 2, and strains it (Batchelor, An Introduction to
    Fluid Dynamics, 1967, section 2.3; doi:10.1017/CBO9780511800955). A free cube in the simple shear u_x = g y drifts
    at the velocity of the fluid at its centre and ends up spinning at -g / 2 about z: the strain pulls on its eight
    sub-cubes without a torque. The flow is not stopped by the walls of the tank, and drag is all that it does: the
    fluid's own acceleration (added mass) is left out.

    gradient : rows du_x/d(x, y, z), du_y/d(x, y, z), du_z/d(x, y, z), 1 / tu; its trace is 0, for the fluid is
        incompressible
    centre : point at which the flow is zero, length; by default the middle of the tank
    """

    needs: ClassVar[tuple[str, ...]] = ("drag",)  # moving fluid reaches the cubes through drag alone
    example: ClassVar[dict[str, Any]] = {"gradient": [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]}
    gradient: tuple[Row, Row, Row]
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        trace = sum(self.gradient[i][i] for i in range(3))
        if abs(trace) > 1e-9 * max(abs(entry) for row in self.gradient for entry in row):
            raise ValueError(
                f"gradient: its trace du_x/dx + du_y/dy + du_z/dz is {trace:.4g}: such a flow compresses the fluid; "
                "expected 0"
            )

    def attach(self, world: ViewOfWorld) -> FlowSource:
        """Make a flow that follows the positions of the cubes."""
        return _Shearing(self, world)


class _Shearing(FlowSource):
    def __init__(self, settings: Shear, world: ViewOfWorld):
        self.world = world
        self.gradient, self.centre = np.array(settings.gradient), np.array(settings.centre)

    def before_step(self) -> None:
        bodies = self.world.bodies
        at_cube = (bodies.centre - self.centre) @ self.gradient.T
        # drag_points @ axes.T are the points' places about the cube's centre; the gradient acts on the last index.
        about = (self.gradient @ bodies.axes) @ self.world.drag_points.T
        np.add(at_cube[:, None], about.transpose(0, 2, 1), out=self.flow)
