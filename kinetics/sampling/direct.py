"""Gillespie's direct method: exact trajectories, one event after another."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.kernels.ensemble_work import ensemble_work
from kinetics.kernels.outcomes import REACHED_END, STOPPED, UNFINISHED
from kinetics.native import twins
from kinetics.network import Network
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.dependency_graph import updating_sampler
from kinetics.sampling.merging import MergedChannels, Merging
from kinetics.sampling.run_source import Sampler
from kinetics.sampling.watch import Watch, in_turn
from kinetics.support.arrays import Floats, Ints

BUFFER = 4096  # events a sampled path grows by


@dataclass(frozen=True)
class Direct(SamplingMethod):
    """The direct method (Gillespie 1977, doi:10.1021/j100540a008), an exact sampling method.

    An event costs about 25 ns plus 2.1 ns per channel; channels that change the counts alike count as one, see
    `sampling.merging`. Choose it for single runs of networks with up to some tens of channels, where no other exact
    method here is faster. If it is cheaper, an event updates only the propensities that it changed, by a dependency
    graph like that of Gibson & Bruck (2000, doi:10.1021/jp993732q); if none are merged, the runs are the same, to
    the last bit.

    >>> from kinetics import Direct, Network, simulate
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> runs = simulate(decay, Direct(), {"A": 100}, [10.0], runs=1000, seed=1)
    >>> bool(abs(runs.mean()[0, 0] - 36.788) < 5 * runs.standard_error()[0, 0])  # 100 / e
    True
    """

    name: ClassVar[str] = "ssa"
    start_cost: ClassVar[float] = 60.0
    takes_until: ClassVar[bool] = True
    takes_crowds: ClassVar[bool] = True

    def prepared(self, network: Network) -> Sampler:
        """The network made ready for `kernels.direct`, or with its dependency graph for `kernels.grouped`."""
        if network.crowding is not None:
            return RecomputingSampler(network)
        size = NetworkSize.of(network)
        return (
            RecomputingSampler(network) if recomputing_cost(size) <= updating_cost(size) else updating_sampler(network)
        )

    def sampler_of_rates(self, network: Network) -> Callable[[Floats], Sampler]:
        """A function from rate constants (R,) to a sampler; microseconds a call in small networks."""
        size = NetworkSize.of(network)
        if recomputing_cost(size) > updating_cost(size):
            return super().sampler_of_rates(network)
        with_units = network.with_rates(np.ones(len(network.channels)))
        self.sampler(with_units)  # refuses what it does not take
        return RecomputingSampler(with_units).with_constants

    def cost(self, size: NetworkSize) -> float:
        """Processor time of an event, ns, by the cheaper way to keep propensities current."""
        return min(recomputing_cost(size), updating_cost(size))


def recomputing_cost(size: NetworkSize) -> float:
    """Processor time, ns, of an event that computes all propensities anew."""
    return 25.0 + 2.1 * size.n_merged + 0.6 * (size.n_channels - size.n_merged)


def updating_cost(size: NetworkSize) -> float:
    """Processor time, ns, of an event that updates only the propensities that it changed; inf in a crowd."""
    return inf if size.in_crowd else 48.0 + size.update_cost + 0.13 * size.n_channels


class RecomputingSampler:
    """Runs in which every event computes all propensities anew."""

    def __init__(self, network: Network):
        self.merging = Merging.of(network)
        self.constants: Floats | None = None
        self.models: dict[bytes, MergedChannels] = {}  # of a crowd, by initial counts
        self.changes = network.stoichiometry[self.merging.representatives]

    def with_constants(self, constants: Floats) -> RecomputingSampler:
        """A copy with rate constants (R,), 1/tu, in place of constants of 1."""
        other = copy(self)
        vars(other).pop("model", None)
        other.constants, other.models = constants, {}
        return other

    @cached_property
    def model(self) -> MergedChannels:
        """The tables that the kernels read, without the factors of a crowd."""
        return self.merging.model(self.constants)

    def model_from(self, initial: Ints) -> MergedChannels:
        """The tables for runs from counts (S,), on which those of a crowd depend."""
        if self.merging.crowded is None:
            return self.model
        asked = initial.tobytes()
        if asked not in self.models:
            self.models[asked] = self.merging.model(self.constants, self.merging.thinning(initial))
        return self.models[asked]

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints, watch: Watch
    ) -> None:
        """Fill `out` (runs, T, S) as far as the watch needs it."""
        work = ensemble_work(initial.size)
        stopping = watch.stop_of(self.merging.representatives), watch.reached_of(first_run, len(out))
        go_on = twins.direct(self.model_from(initial), self.changes, work, initial, grid, key, first_run, out, stopping)
        in_turn(watch, first_run, work.notes, work.clock, work.counts[:-1], go_on)

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int, watch: Watch) -> tuple[Floats, Ints]:
        """Times and channels of all events until `end`."""
        stream, naming = np.empty(4, dtype=np.uint64), np.empty(4, dtype=np.uint64)
        kernels.streams.start_stream(key, run, stream)
        kernels.members.start_naming(key, run, naming)
        counts, state, clock = np.append(initial, 1), np.append(initial, 1), np.zeros(3)
        model, n_channels = self.model_from(initial), len(self.changes)
        named = self.merging.named(self.constants, self.merging.thinning(initial))
        stop, reached = watch.stop_of(self.merging.representatives), watch.reached_of(run, 1)
        pieces = []
        made, look = 0, watch.first_look
        while True:
            room = min(BUFFER, look - made)
            times, channels = np.empty(room), np.empty(room, dtype=np.int64)
            outcome, n_events = twins.events(model, self.changes, counts, clock, end, stream, times, channels, stop)
            made += n_events
            times, channels = times[:n_events], channels[:n_events]
            if model.thinning is not None:  # candidates that were thrown away
                times, channels = times[channels < n_channels], channels[channels < n_channels]
            kernels.members.attribute_channels(named, self.changes, state, channels, naming)
            pieces.append((times, channels))
            watch.hear()
            if outcome == UNFINISHED and made == look:
                look = watch.look(run, made, float(clock[0]), counts[:-1])
            elif outcome == STOPPED and reached is not None:
                reached[0] = clock[0]
            elif outcome not in (UNFINISHED, REACHED_END):
                watch.stop(run, outcome, float(clock[0]), counts[:-1], made)
            if outcome != UNFINISHED or not look:
                break
        all_times, all_channels = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        return all_times, all_channels
