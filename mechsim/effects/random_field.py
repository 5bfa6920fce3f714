"""Agitation by a random, incompressible velocity field with a correlation length and a correlation time."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from kinetics.support.settings import NotNegative, Positive
from mechsim import kernels
from mechsim.effects.base import Effect, FlowSource
from mechsim.effects.ornstein_uhlenbeck import check_memory
from mechsim.effects.view import ViewOfScene, ViewOfWorld


class RandomField(Effect, tag="random-field"):
    """An incompressible random flow, u(x) = sigma sqrt(3/M) sum over M modes of a cos(k.x + phase), a normal to k.

    Random Fourier modes (Kraichnan, Phys. Fluids 13, 22, 1970, doi:10.1063/1.1692799) with a Gaussian spectrum: k ~
    N(0, 1/length^2) a component, so <u(x).u(x+r)> = 3 sigma^2 exp(-r^2 / (2 length^2)). Every mode lives for an
    exponential time T and is then replaced by a new one, so <u(0).u(t)> = 3 sigma^2 exp(-t/T) at a fixed place; both
    hold for any number of modes, which only sets how near to Gaussian the velocities are (excess kurtosis below 3/M).
    In the limit of small lengths any two points are independent; but the modes do not move, so a body that crosses a
    correlation length in less than T sees the flow change sooner. If time and length are both large, the velocity is
    the same everywhere. Cost: M cosines per drag point and step. Choose it where neighbouring cubes must feel the same
    flow.

    sigma : standard deviation of a component, length / tu
    correlation_length : length; at least sigma * step, for within a step the fluid's velocity is taken as constant. A
        current or a shear that carries bodies across the field is not in this check, nor does the run watch for it:
        its speed times the step should be less than the length, too
    correlation_time : T, tu; at least a step. To compare with held noise, take half its hold
    modes : M, the number of modes
    """

    provides: ClassVar[str | None] = "agitation"
    needs: ClassVar[tuple[str, ...]] = ("drag",)  # moving fluid reaches the cubes through drag alone
    example: ClassVar[dict[str, Any]] = {"sigma": 4.0, "correlation_length": 0.3, "correlation_time": 0.00525}
    sigma: NotNegative
    correlation_length: Positive
    correlation_time: Positive
    modes: Annotated[int, Meta(ge=8, le=4096)] = 32

    def check(self, scene: ViewOfScene) -> None:
        """Check that the step resolves the field in time, and in space along the way of its own flow."""
        super().check(scene)
        step = scene.numerics.step
        check_memory(self.effect, self.correlation_time, step)
        if self.correlation_length < self.sigma * step:
            raise ValueError(
                f"{self.effect}.correlation_length = {self.correlation_length} is shorter than the way sigma * step = "
                f"{self.sigma * step:.4g} of this flow in a step: speeds would depend on the step; choose "
                f"numerics.step = {self.correlation_length / self.sigma:.4g} or less"
            )

    def attach(self, world: ViewOfWorld) -> FlowSource:
        """Give the field a random stream of its own."""
        return _Flowing(self, world)


class _Flowing(FlowSource):
    def __init__(self, settings: RandomField, world: ViewOfWorld):
        self.world, self.rng = world, world.stream("agitation")
        self.wave_spread = 1 / settings.correlation_length
        self.push_spread = settings.sigma * math.sqrt(3 / settings.modes)
        self.replaced = -math.expm1(-world.step_size / settings.correlation_time)  # chance of a mode in a step
        self.modes = np.zeros((settings.modes, 7))
        self.renew(1.0)

    def renew(self, chance: float) -> None:
        """Let new modes come for old ones."""
        kernels.fluid.renew(self.modes, chance, self.wave_spread, self.push_spread, self.rng)

    def before_step(self) -> None:
        w = self.world
        if w.step_count:
            self.renew(self.replaced)
        kernels.fluid.flow(w.bodies.centre, w.bodies.axes, w.drag_points, self.modes, self.flow)
