"""Exact leaping: many events at a time where counts are large, and none decided by approximation."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.kernels.ensemble_work import EVENTS, RUN
from kinetics.kernels.leap_limits import LARGEST_COUNT
from kinetics.kernels.outcomes import REACHED_END
from kinetics.network import Network
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.direct import recomputing_cost, updating_cost
from kinetics.sampling.leap_length import OPEN_EVENTS
from kinetics.sampling.mass_action import mass_action
from kinetics.sampling.merging import Merging
from kinetics.sampling.run_source import Sampler
from kinetics.sampling.watch import Watch, in_turn
from kinetics.support.arrays import Floats, Ints

MARGIN = 1.5  # times the events of the direct method that cost as much as a leap, a leap should hold
BUFFER = 2**14  # events that a call of the kernel keeps for a path
MANY = 10.0  # events for each that was drawn, with which a run is not one of single events
CAUTION = 2.0  # counts may fall after the start, by which `auto` chooses


@dataclass(frozen=True)
class Leaping(SamplingMethod):
    """Exact leaping, an exact sampling method whose cost an event falls as 1 / sqrt(copies).

    fewest : events that a leap should be expected to hold; if it would hold fewer, single events are drawn. By
        default 1.5 times as many as cost what a leap costs, and at the start of a run 1,024 single ones; 0: leaps alone

    Numbers of events are drawn from a bounded Poisson process, whose candidates are thinned (Lewis & Shedler 1979,
    doi:10.1002/nav.3800260304); if their order could matter, it is followed by bisection, down to single events if
    need be. So no event is decided by an approximation: counts at all times together have the distribution of the
    direct method, at small counts too. A leap costs about 2 us plus 0.25 us per channel and holds of the order of
    sqrt(copies) events, the smallest count that matters deciding; each time of the output costs some 3 us more. Single
    events cost as much as in `Direct` where that computes all propensities, up to some 20 channels.

    Choose it for mass action with 1e5 copies and more of all that reacts often. It counts up to 2**53 copies, beyond
    which it starts no run. Paths event by event cost some 1 us an event: `Direct` is better at those.

    >>> from kinetics import Leaping, Network, simulate
    >>> decay = Network.from_text("A -> 0, 1")
    >>> runs = simulate(decay, Leaping(), {"A": 10**10}, [1.0], runs=4, seed=1)  # e**-1 of them, 48,000 more or less
    >>> bool((abs(runs.counts - 3_678_794_412) < 5 * 48_223).all())
    True
    """

    fewest: float | None = None
    name: ClassVar[str] = "leaping"
    start_cost: ClassVar[float] = 1.3e3
    max_channels: ClassVar[float] = 2000

    def __post_init__(self) -> None:
        if self.fewest is not None and not 0 <= self.fewest < inf:
            raise ValueError(f"fewest = {self.fewest}; expected a number of events of at least 0, or None")

    def cost(self, size: NetworkSize) -> float:
        """Processor time of an event, ns, with some caution; inf if single events could cost more than in `ssa`."""
        if not size.leap_events or recomputing_cost(size) > updating_cost(size):
            return inf
        return CAUTION * leap_cost(size) / size.leap_events

    def prepared(self, network: Network) -> Sampler:
        """The network made ready for `kernels.leaping`."""
        return LeapingSampler(network, self.fewest)


def leap_cost(size: NetworkSize) -> float:
    """Processor time of a leap, ns."""
    return 2000.0 + 250.0 * size.n_channels


class LeapingSampler:
    """Runs by leaps, and by single events where leaps would be short."""

    def __init__(self, network: Network, fewest: float | None):

        size = NetworkSize.of(network)
        laws, merging, change = mass_action(network), Merging.of(network), network.sparse_stoichiometry
        self.species = network.species
        self.model: kernels.leap_plan.LeapModel = kernels.leap_plan.LeapModel(
            kernels.leap_plan.LeapLaws(laws.coefficients, laws.factors, change.starts, change.columns, change.copies),
            OPEN_EVENTS,
            MARGIN * leap_cost(size) / recomputing_cost(size) if fewest is None else float(fewest),
            merging.model(),
            network.stoichiometry[merging.representatives],
            merging.named(),
        )

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints, watch: Watch
    ) -> None:
        """Fill `out` (runs, T, S) as far as the watch needs it."""
        start, work = (
            self._checked(initial),
            kernels.leap_plan.work_for(len(self.model.laws.coefficients), initial.size),
        )

        def go_on(limits: Ints, most: int) -> int:
            outcome: int = kernels.leaping.ensemble(self.model, work, start, grid, key, first_run, limits, out, most)
            return outcome

        in_turn(watch, first_run, work.notes, work.clock, work.cells.counts[:-1], go_on, _Leaps(work, watch))

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int, watch: Watch) -> tuple[Floats, Ints]:
        """Times and channels of all events until `end`."""
        work = kernels.leap_plan.work_for(len(self.model.laws.coefficients), initial.size)
        kernels.leaping.begin_run(work, self._checked(initial), key, run, watch.first_look)
        grid, out, pieces = np.array([end]), np.empty((1, initial.size), dtype=np.int64), []
        times, channels = np.empty(BUFFER), np.empty(BUFFER, dtype=np.int64)

        def go_on(_: Ints, most: int) -> int:
            room = min(most, BUFFER - kernels.leap_plan.STRETCH - 1)
            outcome, number = kernels.leaping.go_on(self.model, work, grid, out, times, channels, room)
            pieces.append((times[:number].copy(), channels[:number].copy()))
            return REACHED_END if work.notes[RUN] else int(outcome)

        in_turn(watch, run, work.notes, work.clock, work.cells.counts[:-1], go_on, _Leaps(work, watch))
        all_times, all_channels = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        return all_times, all_channels

    def _checked(self, initial: Ints) -> Ints:
        most = initial.max(initial=0)
        if most > LARGEST_COUNT:
            raise ValueError(
                f"species {self.species[int(initial.argmax())]!r} starts with {most} copies; the method 'leaping' "
                f"counts exactly up to 2**53 = {LARGEST_COUNT}: start from fewer, or use 'ssa'"
            )
        return initial


class _Leaps:
    """True if rate equations can forecast the cost of the run, as its events are drawn singly; None within a leap."""

    def __init__(self, work: kernels.leap_plan.LeapWork, watch: Watch) -> None:
        self.work, self.watch = work, watch
        self.time, self.drawn = 0.0, 0  # at the last look

    def __call__(self) -> bool | None:

        if self.work.notes[kernels.leap_plan.CELL] != kernels.leap_plan.NO_CELL:
            return None
        before, begun = self.time, self.drawn
        self.time, self.drawn = float(self.work.clock[0]), int(self.work.notes[EVENTS])
        if self.drawn < begun:  # another run
            before, begun = 0.0, 0
        if self.watch.outlook is None:
            return False
        total = self.watch.outlook.rates(self.work.cells.counts[None, :-1].astype(float), self.time).sum()
        return not total * (self.time - before) > MANY * (self.drawn - begun)
