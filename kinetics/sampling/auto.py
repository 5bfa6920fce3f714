"""Choice of the exact method that costs least on a network, by measured costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import ClassVar

import numpy as np

from kinetics.network import Network
from kinetics.sampling.base import Sampler, SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.exact_methods import EXACT_METHODS
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class Auto(SamplingMethod):
    """The exact sampling method whose events are expected to cost least, among those that take the network.

    many : expect ensembles, whose runs can be made side by side; False for a few long runs

    Choose it unless you know better: it cost at most 1.2 times as much as the best method on a range of networks (see
    `tests/benchmarks/bench_auto_ssa.py`). The choice depends on the network and on `many` alone, so the same seed gives
    the same runs for any number of runs and any grid of times; they are those of the chosen method, to the last bit.

    >>> from kinetics import Auto, Network
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> Auto().choose(decay).name, Auto(many=False).choose(decay).name
    ('lockstep', 'ssa')
    """

    many: bool = True
    name: ClassVar[str] = "auto"
    takes_rate_laws: ClassVar[bool] = True
    takes_events: ClassVar[bool] = True
    most_factors: ClassVar[float] = inf

    def choose(self, network: Network) -> SamplingMethod:
        """The method chosen for this network; a ValueError where none takes it."""
        size = NetworkSize.of(network)
        methods = [kind() for kind in EXACT_METHODS if self.many or not kind.is_for_ensembles]
        refusals = [method.refusal(network, size) for method in methods]
        candidates = [method for method, refusal in zip(methods, refusals, strict=True) if not refusal]
        if not candidates:
            raise ValueError(f"no exact method takes this network: {'; '.join(refusals)}")
        return min(candidates, key=lambda method: method.cost(size))

    def name_for(self, network: Network) -> str:
        """Its name, and that of the chosen method."""
        return f"{self.name} ({self.choose(network).name})"

    def prepared(self, network: Network) -> Sampler:
        """The network made ready for the chosen method."""
        return self.choose(network).prepared(network)

    def sampler_of_rates(self, network: Network) -> Callable[[Floats], Sampler]:
        """That of the chosen method, which does not depend on the rate constants."""
        return self.choose(network.with_rates(np.ones(len(network.channels)))).sampler_of_rates(network)
