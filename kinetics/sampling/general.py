"""Exact runs under any rate law, with thinning where rates depend on time, and with events."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import ClassVar

from kinetics.network import Network
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.general_sampler import GeneralSampler
from kinetics.sampling.run_source import Sampler


@dataclass(frozen=True)
class General(SamplingMethod):
    """The direct method for rate laws of any form, with thinning where they depend on time; an exact sampling method.

    Thinning (Lewis & Shedler 1979, doi:10.1002/nav.3800260304) draws candidates at the rate of an upper bound of the
    propensities and keeps each with the ratio of the true rate to the bound as its probability. Bounds come from the
    rate laws themselves, by interval arithmetic over windows of time that adapt, so the user supplies neither a bound
    nor a step. Choose it for rate laws and events. A mass-action network gets the runs of `Direct`, to the last bit, at
    a higher cost: about 95 ns an event, plus 0.4 ns per channel and 1.4 times what updating its propensities costs.

    >>> from kinetics import General, Network, simulate
    >>> tides = Network.from_text("0 -> A, 5 * (1 + cos(t))")  # of time t: Poisson, with mean 5 (t + sin t)
    >>> runs = simulate(tides, General(), {"A": 0}, [3.141592653589793], runs=1000, seed=1)
    >>> bool(abs(runs.mean()[0, 0] - 15.708) < 5 * runs.standard_error()[0, 0])
    True
    """

    name: ClassVar[str] = "general"
    start_cost: ClassVar[float] = 18e3
    takes_until: ClassVar[bool] = True
    takes_rate_laws: ClassVar[bool] = True
    takes_events: ClassVar[bool] = True
    most_factors: ClassVar[float] = inf

    def cost(self, size: NetworkSize) -> float:
        """Processor time of an event, ns, under mass action; in a crowd, any method that takes it costs far less."""
        if size.in_crowd:
            return inf
        return 95.0 + 1.4 * size.update_cost + 0.38 * size.n_channels

    def prepared(self, network: Network) -> Sampler:
        """The network made ready for `kernels.general`."""
        return GeneralSampler(network)
