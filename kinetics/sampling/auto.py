"""Choice of the exact method that costs least on a network, by measured costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.crowds import has_bounds
from kinetics.sampling.exact_methods import EXACT_METHODS
from kinetics.sampling.leap_length import FEWEST_COPIES
from kinetics.sampling.run_source import Sampler
from kinetics.sampling.watch import Watch
from kinetics.support.arrays import Counts, Floats, Ints


@dataclass(frozen=True)
class Auto(SamplingMethod):
    """The exact sampling method whose events are expected to cost least, among those that take the network.

    many : expect ensembles, whose runs can be made side by side; False for a few long runs

    Choose it unless you know better: on nearly all of a range of networks it cost at most 1.3 times as much as the best
    method (see `tests/benchmarks/bench_auto_ssa.py`). The choice depends on the network, its initial counts and `many`
    alone, so the same seed gives the same runs for any number of runs and any grid of times; they are those of the
    chosen method, to the last bit. Initial counts matter where some are above 10,000: `Leaping` may then be cheaper.

    >>> from kinetics import Auto, Network
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> Auto().choose(decay).name, Auto(many=False).choose(decay).name
    ('lockstep', 'ssa')
    >>> Auto().choose(decay, {"A": 10**8}).name
    'leaping'
    """

    many: bool = True
    name: ClassVar[str] = "auto"
    takes_rate_laws: ClassVar[bool] = True
    takes_events: ClassVar[bool] = True
    takes_until: ClassVar[bool] = True
    most_factors: ClassVar[float] = inf

    def choose(self, network: Network, initial: Counts | None = None, until: bool = False) -> SamplingMethod:
        """The method chosen for this network, from these counts if given; a ValueError if none takes it.

        until : whether runs are to end at a condition
        """
        size = NetworkSize.of(network, None if initial is None else network.state(initial))
        kinds = [kind for kind in EXACT_METHODS if kind.takes_until or not until]
        methods = [kind() for kind in kinds if self.many or not kind.is_for_ensembles]
        refusals = [method.unsupported_reason(network, size) for method in methods]
        candidates = [method for method, refusal in zip(methods, refusals, strict=True) if not refusal]
        if not candidates:
            raise ValueError(f"no exact method supports this network: {'; '.join(refusals)}")
        return min(candidates, key=lambda method: method.cost(size))

    def name_for(self, network: Network, initial: Counts) -> str:
        """The name `auto` with the name of the method chosen for this network and these counts."""
        return f"{self.name} ({self.choose(network, initial).name})"

    def stopping(self, network: Network, initial: Counts) -> SamplingMethod:
        """The method chosen among those that end runs at a condition."""
        return self.choose(network, initial, until=True)

    def prepared(self, network: Network) -> Sampler:
        """The network made ready for the method that the initial counts of its runs will choose."""
        return ChoosingSampler(
            self.choose(network).prepared(network),
            lambda initial: self.choose(network, initial).prepared(network),
            partial(is_usual, network),
        )

    def sampler_of_rates(self, network: Network) -> Callable[[Floats], Sampler]:
        """A function from rate constants (R,) to a sampler; its method is chosen once, but for large counts."""
        of_rates = self.choose(network.with_rates(np.ones(len(network.channels)))).sampler_of_rates(network)

        def chosen(constants: Floats, initial: Ints) -> Sampler:
            model = network.with_rates(constants)
            return self.choose(model, initial).prepared(model)

        usual: dict[bytes, bool] = {}

        def takes_usual(initial: Ints) -> bool:
            asked = initial.tobytes()
            if asked not in usual:
                usual[asked] = is_usual(network, initial)
            return usual[asked]

        return lambda constants: ChoosingSampler(of_rates(constants), partial(chosen, constants), takes_usual)


def is_usual(network: Network, initial: Ints) -> bool:
    """Whether these counts are too small for leaps to pay, and bound the factors of a crowd if there is one."""
    return initial.max(initial=0) < FEWEST_COPIES and has_bounds(network, initial)


class ChoosingSampler:
    """Runs of the method that is chosen by their initial counts, which come with the runs.

    usual : the sampler of counts for which is_usual(initial); of_others(initial) gives the sampler of other counts
    """

    def __init__(self, usual: Sampler, of_others: Callable[[Ints], Sampler], is_usual: Callable[[Ints], bool]):
        self.usual, self.of_others, self.is_usual = usual, of_others, is_usual
        self.chosen: dict[bytes, Sampler] = {}

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints, watch: Watch
    ) -> None:
        """Fill `out` (runs, T, S) as far as the watch needs it."""
        self._from(initial).ensemble(initial, grid, key, first_run, out, watch)

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int, watch: Watch) -> tuple[Floats, Ints]:
        """Times and channels of all events until `end`."""
        return self._from(initial).path(initial, end, key, run, watch)

    def _from(self, initial: Ints) -> Sampler:
        if self.is_usual(initial):
            return self.usual
        asked = initial.tobytes()
        if asked not in self.chosen:
            self.chosen[asked] = self.of_others(initial)
        return self.chosen[asked]
