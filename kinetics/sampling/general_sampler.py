"""A network as programs for `kernels.general`, and the runs made by it."""

from __future__ import annotations

from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.kernels import outcomes
from kinetics.network import Network
from kinetics.network.laws.graph import Code
from kinetics.network.laws.program import Step, depth, steps_of
from kinetics.network.propensity import over_factorial, state_text
from kinetics.sampling.buffered import BufferedSampler
from kinetics.sampling.watch import Watch
from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import sparse

MOST_WAITING = 1000  # delayed events of one run at a time


class GeneralSampler(BufferedSampler):
    """Runs of `kernels.general`; what goes wrong is reported with channel or event, counts and time."""

    def __init__(self, network: Network) -> None:

        self.network = network
        self.n_blocks = -(-len(network.channels) // kernels.blocks.BLOCK)
        self.events = sorted(network.events, key=lambda event: -event.priority)
        self.model, self.deepest = self._model()
        super().__init__(lambda _: self._begin(), self._advance, np.arange(len(network.channels)))

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int, watch: Watch) -> tuple[Floats, Ints]:
        """Times and channels of all events until `end`."""
        if self.events:
            raise ValueError(
                f"a path records firings of channels only, but event {self.events[0].name!r} sets counts: ask for "
                f"counts at times with simulate(...)"
            )
        return super().path(initial, end, key, run, watch)

    def _begin(self) -> kernels.general.GeneralWork:

        n_programs = self.model.programs.starts.size - 1
        n_entries = MOST_WAITING if self.events else 0
        results, lows, highs = np.zeros((3, n_programs))
        sums, caps, upto = np.zeros((3, self.n_blocks))
        return kernels.general.GeneralWork(
            results,
            lows,
            highs,
            sums,
            caps,
            upto,
            np.empty((2, self.deepest + 1)),
            self.model.was_true.copy(),
            np.empty(self.model.assigned.size),
            np.empty(n_entries),
            np.empty(n_entries, dtype=np.int64),
            np.empty((n_entries, int(np.diff(self.model.assign_starts).max(initial=0)))),
            np.array([0.0, 1.0, 0.0]),  # a first window of 1 tu, which adapts at once
            np.zeros(3, dtype=np.int64),
        )

    def _advance(self, work: kernels.general.GeneralWork, counts: Ints, seen: Ints, clock: Floats, *rest: Any) -> int:

        outcome: int = kernels.general.advance(self.model, work, counts, seen, clock, *rest)
        if outcome <= outcomes.OVERFLOW or outcome == outcomes.STOPPED:
            return outcome
        about, state, t = int(work.notes[1]), counts[:-1], float(clock[0])
        where = f"at {state_text(self.network.species, state)}, t = {t:.17g}"
        if outcome == outcomes.BAD_COUNT:
            event = self.events[int(np.searchsorted(self.model.assign_starts, about, side="right")) - 1]
            name = self.network.species[self.model.assigned[about]]
            raise ValueError(
                f"event {event.name!r} sets {name!r} to {event.new_counts[name]} = {work.held[about]:g} {where}; "
                f"expected a whole number from 0 to 2**53: write floor(...) or max(0, ...) if that is meant"
            )
        if outcome in (outcomes.BAD_DELAY, outcomes.CROWDED):
            event = self.events[about]
            why = (
                f"is no finite number of at least 0 {where}"
                if outcome == outcomes.BAD_DELAY
                else f"is too long: over {MOST_WAITING} of its kind wait at a time, {where}"
            )
            raise ValueError(f"event {event.name!r}: the delay {event.waits} {why}")
        if outcome in (outcomes.UNDECIDED, outcomes.ENDLESS):
            event = self.events[about]
            why = (
                "cannot be determined: it touches its threshold, or oscillates too fast"
                if outcome == outcomes.UNDECIDED
                else "has no end: simultaneous events trigger each other"
            )
            raise ValueError(f"event {event.name!r}: when {event.condition} turns true {why}, {where}")
        if outcome == outcomes.BROKEN_BOUND:
            raise ArithmeticError(f"a propensity exceeds its bound {where}; please report this network")
        channel = self.network.channels[about]
        if channel not in self.network.laws:
            return outcomes.OVERFLOW
        if outcome == outcomes.UNBOUNDED:
            raise ValueError(
                f"the law of channel {channel!r}, {self.network.laws[channel]}, has no finite bound right after t = "
                f"{t:.17g} {where}; without one there are no exact runs: keep it away from its pole, as by min(...)"
            )
        raise ValueError(self.network.channel_laws[channel].refusal(state, t))

    def _model(self) -> tuple[kernels.general.GeneralModel, int]:
        """The network as the kernel reads it, and the deepest stack of its programs."""
        network = self.network
        places = {name: s for s, name in enumerate(network.species)}
        channels = channel_programs(network)
        conditions = [steps_of(event.condition, places) for event in self.events]
        new_counts = [steps_of(law, places) for event in self.events for law in event.new_counts.values()]
        delays = [steps_of(event.waits, places) for event in self.events]
        all_programs = [*channels, *conditions, *new_counts, *delays]
        steps = [step for program in all_programs for step in program]
        table = kernels.programs.Programs(
            np.array([step.code for step in steps], dtype=np.int32),
            np.array([step.operand for step in steps], dtype=np.int32),
            np.array([step.number for step in steps]),
            np.array([0, *accumulate(map(len, all_programs))]),
        )
        n_channels, n_conditions = len(channels), len(conditions)
        is_timed = np.array([reads_time(program) for program in channels], dtype=bool)
        clocked = [e for e, program in enumerate(conditions) if reads_time(program)]
        read = readers_of([program for program, timed in zip(channels, is_timed, strict=True) if not timed])
        steady = np.flatnonzero(~is_timed)
        starts, readers = changed_readers(network, [(steady[p], s) for p, s in read])
        timed_programs = [program for program, timed in zip(channels, is_timed, strict=True) if timed]
        change = network.sparse_stoichiometry
        model = kernels.general.GeneralModel(
            table,
            change.starts,
            change.columns,
            change.copies,
            steady,
            np.flatnonzero(is_timed),
            starts,
            readers,
            touches(network, [*timed_programs, *(conditions[e] for e in clocked)]),
            touches(network, conditions),
            n_channels + np.arange(n_conditions),
            n_channels + n_conditions + np.arange(len(new_counts)),
            n_channels + n_conditions + len(new_counts) + np.arange(n_conditions),
            np.array(clocked, dtype=np.int64),
            np.array([event.was_true for event in self.events], dtype=bool),
            np.array([event.from_trigger for event in self.events], dtype=bool),
            np.array([event.persistent for event in self.events], dtype=bool),
            np.array([event.is_delayed for event in self.events], dtype=bool),
            np.array([0, *accumulate(len(event.assign) for event in self.events)]),
            np.array([places[name] for event in self.events for name in event.assign], dtype=np.int64),
        )
        return model, max(map(depth, all_programs), default=0)


def channel_programs(network: Network) -> list[list[Step]]:
    """Propensities k * N * h as programs."""
    coefficients = network.known_rates * network.ways
    programs = []
    for r, (name, k) in enumerate(zip(network.channels, coefficients.tolist(), strict=True)):
        if k == 0.0:
            programs.append([Step(Code.CONSTANT)])
        elif name in network.laws:
            law = network.channel_laws[name].program
            programs.append(law if k == 1.0 else [*law, Step(Code.CONSTANT, 0, k), Step(Code.MULTIPLY)])
        else:
            programs.append(_mass_action(network, r, k))
    return programs


def _mass_action(network: Network, r: int, coefficient: float) -> list[Step]:
    """The factors of `sampling.mass_action`, in the same order."""
    guards, factors = [], []
    for species, copies in zip(*(part.tolist() for part in network.sparse_reactants.row(r)), strict=True):
        if network.combinations == "product":
            guards.append(Step(Code.GUARD, species, float(copies)))
            factors += [Step(Code.TIMES, species)] * copies
        else:
            factors += [Step(Code.TIMES, species, float(taken)) for taken in range(copies)]
        if network.combinations == "distinct" and copies > 1:
            coefficient = over_factorial(coefficient, copies, network.channels[r])
    return [*guards, Step(Code.CONSTANT, 0, coefficient), *factors]


def reads_time(program: list[Step]) -> bool:
    """Whether a program depends on the time."""
    return any(step.code == Code.CLOCK for step in program)


def readers_of(programs: list[list[Step]]) -> list[tuple[int, int]]:
    """Pairs of a program and a species that it reads."""
    reading = (Code.COUNT, Code.TIMES, Code.GUARD, Code.REFUSE)
    return sorted({(p, step.operand) for p, program in enumerate(programs) for step in program if step.code in reading})


def changed_readers(network: Network, read: list[tuple[int, int]]) -> tuple[Ints, Ints]:
    """For each channel, the channels whose propensity its firing changes: where they start, and which they are."""
    change = network.sparse_stoichiometry
    changes = sparse.csr_array((np.ones(change.columns.size), change.columns, change.starts), shape=change.shape)
    owners, species = np.array(read, dtype=np.int64).reshape(-1, 2).T
    reads = sparse.csr_array((np.ones(owners.size), (species, owners)), shape=(change.shape[1], change.shape[0]))
    linked = sparse.csr_array(changes @ reads)
    linked.sort_indices()
    return linked.indptr.astype(np.int64), linked.indices.astype(np.int64)


def touches(network: Network, programs: list[list[Step]]) -> NDArray[np.bool_]:
    """(R,) whether a firing changes what any of the programs reads."""
    is_read = np.zeros(len(network.species), dtype=bool)
    is_read[[species for _, species in readers_of(programs)]] = True
    change = network.sparse_stoichiometry
    return np.bincount(change.rows, is_read[change.columns], len(network.channels)) > 0
