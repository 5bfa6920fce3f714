"""Quadratic drag integrated by explicit Euler steps, for comparison with the semi-implicit scheme."""

from __future__ import annotations

import math

from mechsim.effects.base import Action, Stopped
from mechsim.effects.drag import DragPoints, QuadraticDrag, drag_points
from mechsim.effects.view import ViewOfScene, ViewOfWorld
from mechsim.kernels.forces import explicit_drag

# Of step * mean relaxation rate. The noise multiplies the rate, so speeds run away from 0.93 on (measured), well before
# 2, the limit at a constant rate.
BOUND = 0.9


class ExplicitDrag(QuadraticDrag, tag="explicit-drag"):
    """Quadratic drag by explicit Euler steps, dv = F h / m, with force and torque from the start of the step.

    In fluid agitated by sigma a free cube relaxes at the mean rate 4/3 c E|u| / m, E|u| = sigma sqrt(8/pi), c = Cd rho
    A / 2 over all its points (the push of |u| u changes by 2 |u| along u, |u| across). A scene whose step times this
    rate exceeds 0.9 is refused. A steady flow (current, shear) adds to the rate by its speed relative to the body,
    which falls as the body is carried along: it is not in this check. Whatever moves fluid and bodies, a run in which
    the step times twice the present rate of a body exceeds 2 is stopped. Below the bounds speeds are too high: by 11 %
    at 0.25, 25 % at 0.47. Choose it only to compare with `drag`.
    """

    def check(self, scene: ViewOfScene) -> None:
        """Check that the step is within the bound of stability under agitation; other flow is guarded in the run."""
        super().check(scene)
        agitation = scene.provider("agitation")
        if agitation is None:
            return  # speeds relative to a fluid at rest or in steady flow are known only in the run
        rate = self.relaxation_rate(agitation.sigma, scene.cubes.edge, scene.cubes.density)
        step = scene.numerics.step
        if rate * step > BOUND:
            raise ValueError(
                f"{self.effect} is unstable: a step of {step} is {rate * step:.3g} times the relaxation time of a cube "
                f"at sigma = {agitation.sigma}, at most {BOUND} is allowed; choose numerics.step = {BOUND / rate:.3g} "
                "or less, or effect 'drag', which is stable at any step"
            )

    def relaxation_rate(self, sigma: float, edge: float, density: float) -> float:
        """Mean rate at which a free cube takes on the velocity of the agitated fluid, 1 / tu."""
        area = drag_points(self.points)[1].sum() * (edge / 2) ** 2
        drag = 0.5 * self.coefficient * self.fluid_density * area * sigma * math.sqrt(8 / math.pi)
        return 4 / 3 * drag / (density * edge**3)

    def attach(self, world: ViewOfWorld) -> Action:
        """Lay out the drag points of every cube."""
        return _Pushing(self, world)


class _Pushing(DragPoints):
    def before_step(self) -> None:
        b, w = self.world.bodies, self.world
        stiffest, slot = explicit_drag(
            b.live, b.first, b.flat, self.points, self.areas, w.fluid,
            b.orientation, b.velocity, b.spin, b.mass, b.inertia, self.coefficient, w.step_size,
        )  # fmt: skip
        if not stiffest <= 1.0:
            raise Stopped(
                f"explicit drag is unstable: the step is {2 * stiffest:.3g} times the shortest relaxation time of "
                f"{b.title(slot)}, at most 2 is allowed"
            )
