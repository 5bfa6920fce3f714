"""Committors: which of several targets a chain reaches first, when, through which states, and along which paths."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network
from kinetics.passage.elimination import Elimination, equations, mean_over, relative_error
from kinetics.passage.entry import reached_states
from kinetics.passage.sampled import sampled_jumps
from kinetics.runs import JumpPath
from kinetics.solving import StateSpace, Transitions
from kinetics.solving.states import MAX_STATES
from kinetics.solving.transitions import totals
from kinetics.support.arrays import Floats, Ints, read_only

Target = Callable[[Ints], NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class ChainCommittor:
    """The probabilities that each of several targets is reached first, from every state of a chain.

    transitions : of the chain, which stops in the targets
    targets : K names
    committors : (K, N) probability that each target is reached first, from each state
    probabilities : (K,) the same from the start
    never : probability of reaching none, that is, of entering states from which no target can be reached
    mean_times : (K,) mean time, tu, of the runs that reach each target first; nan where none does
    occupation : (N,) expected time, tu, in each state until a target is reached or none can be reached any more
    error : relative error of all of these
    is_bound : whether the error is proven; not where the states are too many to eliminate, or a rate law unbounded
    """

    transitions: Transitions
    targets: tuple[str, ...]
    committors: Floats
    probabilities: Floats
    never: float
    mean_times: Floats
    occupation: Floats
    error: float
    is_bound: bool

    def __post_init__(self) -> None:
        for array in (self.committors, self.probabilities, self.mean_times, self.occupation):
            read_only(array)

    def sample_entries(self, target: str, row: int, seed: int = 0, run: int = 0) -> tuple[Floats, Ints]:
        """Times (n,), tu, and places (n,) in `transitions` of the jumps of one run from state `row` until `target`.

        It is drawn from the runs that reach the target first, however few (Doob's h-transform): the chain goes from x
        to y at its rate times committor(y) / committor(x).
        """
        if target not in self.targets:
            raise ValueError(f"unknown target {target!r}; there are {', '.join(self.targets)}")
        chances = self.committors[self.targets.index(target)]
        if chances[row] == 0.0:
            raise ValueError(f"target {target!r} is never reached first; there are no such runs")
        return sampled_jumps(self.transitions, row, np.inf, seed, run, chances)

    def __str__(self) -> str:
        reached = zip(self.targets, self.probabilities, strict=True)
        return ", ".join([*(f"{name}: {chance:.4g}" for name, chance in reached), f"none: {self.never:.4g}"])


@dataclass(frozen=True, eq=False)
class Committor(ChainCommittor):
    """The probabilities that each of several targets is reached first, from every state of a network.

    space : the states
    """

    space: StateSpace

    def sample_path(self, target: str, seed: int = 0, run: int = 0) -> JumpPath:
        """One run until `target`, drawn from the runs that reach it first, however few: see `sample_entries`."""
        times, entries = self.sample_entries(target, 0, seed, run)
        channels = np.asarray(self.transitions.channels)[entries]
        return JumpPath(
            self.space.network, self.space.states[0], times, channels, float(times[-1]) if times.size else 0.0
        )


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
    start = np.eye(1, len(space))[0]
    found = committor_of(space.transitions(), start, dict(zip(targets, belongs(space.states), strict=True)))
    return Committor(**vars(found), space=space)


def committor_of(transitions: Transitions, start: Floats, targets: Mapping[str, NDArray[np.bool_]]) -> ChainCommittor:
    """The committors of any chain from a start spread as `start` (N,); targets: name -> states (N,), none in two."""
    member = np.array(list(targets.values()))
    is_target: NDArray[np.bool_] = np.logical_or.reduce(member)
    stopped = transitions.stopped(is_target)
    rows, columns, rates, *_ = stopped
    way = stopped.leading_to(is_target) & ~is_target
    lost, first, size = ~way & ~is_target, start[way], int(way.sum())
    committors, occupation = member.astype(float), np.zeros(start.size)
    probabilities, never = member @ start, float(start[lost].sum())
    times = np.where(probabilities > 0, 0.0, np.nan)
    error, is_bound = 0.0, transitions.is_certified
    if first.any():
        place = np.where(way, np.cumsum(way) - 1, -1)
        inside = way[rows] & way[columns]
        out = way[rows] & ~way[columns]
        here, there, gone = place[rows[out]], columns[out], rates[out]
        leaving = totals(here, gone, size)
        chain = equations(place[rows[inside]], place[columns[inside]], rates[inside], leaving, stopped.roundings)
        is_bound &= isinstance(chain, Elimination)
        for k, targeted in enumerate(member):
            chances = chain.solve(totals(here, gone * targeted[there], size))
            committors[k, way] = np.minimum(chances, 1.0)
            if first @ chances > 0:
                probabilities[k] = min(probabilities[k] + float(first @ committors[k, way]), 1.0)
                # E[time; this end] solves the same equations with the chance of this end as what is earned.
                times[k] = mean_over(first, chain.solve(chances)) / probabilities[k]
                error = max(error, relative_error(chain, chances, first))
        never += float(first @ chain.solve(totals(here, gone * lost[there], size)))
        occupation[way] = chain.occupation(first)
    names = tuple(targets)
    return ChainCommittor(stopped, names, committors, probabilities, never, times, occupation, 2.0 * error, is_bound)
