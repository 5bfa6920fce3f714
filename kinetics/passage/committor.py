"""Committors: which of several targets a chain reaches first, when, through which states, and along which paths."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network
from kinetics.passage.elimination import equations, relative_error, totals
from kinetics.passage.entry import reached_states
from kinetics.runs import JumpPath
from kinetics.solving import StateSpace
from kinetics.solving.states import MAX_STATES
from kinetics.support.arrays import Floats, Ints, read_only, whole_number

Target = Callable[[Ints], NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class Committor:
    """The probabilities that each of several targets is reached first, from every state.

    targets : K names
    committors : (K, N) probability that each target is reached first, from each state
    probabilities : (K,) the same from the initial state
    never : probability of reaching none, that is, of entering states from which no target can be reached
    mean_times : (K,) mean time, tu, of the runs that reach each target first; nan where none does
    occupation : (N,) expected time, tu, in each state until a target is reached or none can be reached any more
    error : relative error of all of these: a bound, or for very many states an estimate
    """

    space: StateSpace
    targets: tuple[str, ...]
    committors: Floats
    never: float
    mean_times: Floats
    occupation: Floats
    error: float

    def __post_init__(self) -> None:
        for array in (self.committors, self.mean_times, self.occupation):
            read_only(array)

    @property
    def probabilities(self) -> Floats:
        """Probability (K,) that each target is reached first, from the initial state."""
        return self.committors[:, 0]

    def sample_path(self, target: str, seed: int = 0, run: int = 0) -> JumpPath:
        """One run until `target`, drawn from the runs that reach it first, however few (Doob's h-transform).

        A channel that leads from x to y fires at its rate times committor(y) / committor(x).
        """
        chances = self.committors[self._index(target)]
        if chances[0] == 0.0:
            raise ValueError(f"target {target!r} is never reached first; there are no such runs")
        sequence = np.random.SeedSequence(whole_number("seed", seed, 0), spawn_key=(whole_number("run", run, 0),))
        rng = np.random.default_rng(sequence)
        network, states = self.space.network, self.space.states
        changes = network.sparse_stoichiometry
        row, now, times, channels = 0, 0.0, [], []
        while not self.space.is_stopped[row]:
            rates = network.propensities(states[row])
            able = np.flatnonzero((rates > 0) & changes.has_entries)
            ends = self.space.index_of(changes.added_to(np.tile(states[row], (able.size, 1)), able))
            biased = np.cumsum(rates[able] * (chances[ends] / chances[row]))
            now += rng.exponential() / biased[-1]
            chosen = min(int(np.searchsorted(biased, rng.random() * biased[-1], side="right")), able.size - 1)
            times.append(now)
            channels.append(able[chosen])
            row = int(ends[chosen])
        return JumpPath(network, states[0], np.array(times), np.array(channels, dtype=np.int64), now)

    def _index(self, target: str) -> int:
        if target not in self.targets:
            raise ValueError(f"unknown target {target!r}; there are {', '.join(self.targets)}")
        return self.targets.index(target)


def committor(
    network: Network, initial: ArrayLike, targets: Mapping[str, Target], max_states: int = MAX_STATES
) -> Committor:
    """Committors of `targets`: the probability that each is reached first, from `initial` and from every state.

    targets : name -> function of states (n, S) that says which of them belong to the target (n,)
    max_states : networks with more reachable states are refused
    ValueError: no targets, a state in two of them, missing rates, or too many states

    The equations of first-step analysis are solved by elimination without subtractions (see `elimination`). Every
    figure is a sum of positive terms, so that even a probability of 1e-30 keeps its relative accuracy. The cost is that
    of the elimination, states times the square of the band's width, and two substitutions per target. Choose it where
    the states can be listed, and `rare_event` where they cannot.
    """
    if not targets:
        raise ValueError("no targets; give at least one, as in {'extinct': lambda states: states[:, 0] == 0}")

    def belongs(states: Ints) -> NDArray[np.bool_]:
        tables = [np.asarray(test(states), dtype=bool) for test in targets.values()]
        for name, table in zip(targets, tables, strict=True):
            if table.shape != (len(states),):
                raise ValueError(
                    f"target {name!r} gives shape {table.shape}; expected one truth a state, ({len(states)},)"
                )
        both = np.sum(tables, axis=0) > 1
        if both.any():
            raise ValueError(
                f"state {states[np.argmax(both)].tolist()} belongs to two targets; make them exclude each other"
            )
        return np.array(tables)

    def is_target(states: Ints) -> NDArray[np.bool_]:
        return np.logical_or.reduce(belongs(states))

    space = reached_states(network, initial, max_states, is_target)
    member = belongs(space.states)
    rows, columns, rates, _ = space.transitions()
    n, committors = len(space), member.astype(float)
    way = _leading(rows, columns, space.is_stopped) & ~space.is_stopped
    times, occupation, error, never = np.full(len(targets), np.nan), np.zeros(n), 0.0, float(not way[0])
    if space.is_stopped[0]:
        never, times = 0.0, np.where(member[:, 0], 0.0, np.nan)
    elif way[0]:
        place = np.where(way, np.cumsum(way) - 1, -1)
        inside = way[rows] & way[columns]
        out = way[rows] & ~way[columns]
        here, there, gone = place[rows[out]], columns[out], rates[out]
        size = int(way.sum())
        leaving = totals(here, gone, size)
        chain = equations(place[rows[inside]], place[columns[inside]], rates[inside], leaving)
        for k, targeted in enumerate(member):
            chances = chain.solve(totals(here, gone * targeted[there], size))
            committors[k, way] = np.minimum(chances, 1.0)
            if chances[0] > 0:
                # E[time; this end] solves the same equations with the chance of this end as what is earned.
                times[k] = chain.solve(chances)[0] / chances[0]
                error = max(error, relative_error(chain, chances, 0))
        lost = ~way & ~space.is_stopped
        never = float(chain.solve(totals(here, gone * lost[there], size))[0])
        occupation[way] = chain.occupation(np.eye(1, size)[0])
    return Committor(space, tuple(targets), committors, never, times, occupation, 2.0 * error)


def _leading(rows: Ints, columns: Ints, goals: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which states (N,) have some way to a goal."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order

    # Backwards from one more state to which all goals lead.
    n = goals.size
    reached = np.flatnonzero(goals)
    backwards = csr_array(
        (np.ones(rows.size + reached.size), (np.append(columns, np.full(reached.size, n)), np.append(rows, reached))),
        shape=(n + 1, n + 1),
    )
    leads = np.zeros(n + 1, dtype=bool)
    leads[breadth_first_order(backwards, n, return_predecessors=False)] = True
    return leads[:n]
