"""Agitation by an Ornstein-Uhlenbeck process: a fluid velocity at every drag point with a correlation time."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from kinetics.support.settings import NotNegative, Positive
from mechsim.effects.base import Effect, FlowSource
from mechsim.effects.view import ViewOfScene, ViewOfWorld


class OrnsteinUhlenbeck(Effect, tag="ornstein-uhlenbeck"):
    """Agitation by du = -u dt/T + sigma sqrt(2/T) dW, independently for each component and drag point.

    The update is exact at any step h: u(t+h) = r u(t) + sigma sqrt(1 - r^2) N(0, 1) with r = exp(-h/T) (Gillespie,
    Phys. Rev. E 54, 2084, 1996, doi:10.1103/PhysRevE.54.2084), so spread and memory do not depend on the step:
    <u(0) u(t)> = sigma^2 exp(-t/T). Held noise of the same sigma, redrawn every `hold`, has memory sigma^2 (1 -
    t/hold), area sigma^2 hold / 2. With correlation_time = hold / 2 both drive slow bodies alike: what moves a body
    that averages over many redraws is the area alone. Cost: one normal random number per component, drag point and
    step. Choose it where a smooth memory matters.

    sigma : standard deviation of a component, length / tu
    correlation_time : T, tu; at least a step, for within a step the fluid's velocity is taken as constant
    """

    provides: ClassVar[str | None] = "agitation"
    needs: ClassVar[tuple[str, ...]] = ("drag",)  # moving fluid reaches the cubes through drag alone
    example: ClassVar[dict[str, Any]] = {"sigma": 4.0, "correlation_time": 0.00525}
    sigma: NotNegative
    correlation_time: Positive

    def check(self, scene: ViewOfScene) -> None:
        """Check that the step resolves the correlation time."""
        super().check(scene)
        check_memory(self.effect, self.correlation_time, scene.numerics.step)

    def attach(self, world: ViewOfWorld) -> FlowSource:
        """Give the fluid a random stream of its own."""
        return _Remembering(self, world)


def check_memory(effect: str, correlation_time: float, step: float) -> None:
    """ValueError where the step is longer than the fluid's memory: the motion would depend on the step."""
    if step > correlation_time:
        raise ValueError(
            f"{effect}.correlation_time = {correlation_time} is shorter than the step of {step}: speeds would depend "
            f"on the step; choose numerics.step = {correlation_time} or less"
        )


class _Remembering(FlowSource):
    def __init__(self, settings: OrnsteinUhlenbeck, world: ViewOfWorld):
        self.sigma, self.world = settings.sigma, world
        ratio = world.step_size / settings.correlation_time
        self.kept = math.exp(-ratio)
        self.fresh = settings.sigma * math.sqrt(-math.expm1(-2 * ratio))
        self.rng = world.stream("agitation")

    def before_step(self) -> None:
        noise = self.rng.standard_normal(self.flow.shape)
        if self.world.step_count == 0:  # starts as it will stay
            self.flow[:] = self.sigma * noise
        else:
            self.flow *= self.kept
            noise *= self.fresh
            self.flow += noise
