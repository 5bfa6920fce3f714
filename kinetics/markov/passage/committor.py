"""Committors: which of several targets a chain reaches first, when, through which states, and along which paths."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.certified import leaving_rates
from kinetics.markov.passage.entry import reached_states
from kinetics.markov.passage.equations import equations
from kinetics.markov.passage.sampled import sampled_jumps
from kinetics.markov.passage.until import UNDERFLOW
from kinetics.markov.transient import StateSpace, Transitions
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.search import MAX_STATES
from kinetics.network import Model, Network
from kinetics.runs import JumpPath
from kinetics.support.arrays import Counts, Floats, Ints, read_only
from kinetics.support.shown import ResultTable, Shown
from kinetics.support.tables import figure

Target = Callable[[Ints], NDArray[np.bool_]]


@dataclass(frozen=True, eq=False, repr=False)
class ChainCommittor(Shown):
    """The probabilities that each of several targets is reached first, from every state of a chain.

    transitions : of the chain, which stops in the targets
    targets : K names
    committors : (K, N) probability that each target is reached first, from each state
    probabilities : (K,) the same from the start
    never : probability of reaching none, that is, of entering states from which no target can be reached
    mean_times : (K,) mean time, tu, of the runs that reach each target first; nan where none does
    occupation : (N,) expected time, tu, in each state until a target is reached or none can be reached any more
    lost : (N,) probability of leaving a part of a larger chain before any target, from each state; all else is then
        of the runs that do not, so that each committor lies between `committors` and `committors + lost`
    lost_probability : the same from the start
    error : relative error of all of these, rounding of the rates included; probabilities below 1e-290 may be lost
    is_bound : whether the error is proven; not by a rate law that cannot be bounded
    """

    transitions: Transitions
    targets: tuple[str, ...]
    committors: Floats
    probabilities: Floats
    never: float
    mean_times: Floats
    occupation: Floats
    lost: Floats
    lost_probability: float
    error: float
    is_bound: bool

    def __post_init__(self) -> None:
        for array in (self.committors, self.probabilities, self.mean_times, self.occupation, self.lost):
            read_only(array)

    @property
    def headline(self) -> str:
        """Which target is reached first, and how often."""
        return f"reached first: {self}; {self.occupation.size} states"

    def summary(self) -> ResultTable:
        """Probability with limits and mean time of each target."""
        rows = []
        for k, name in enumerate(self.targets):
            low, high = self.probability_bounds(name)
            rows.append((name, f"{self.probabilities[k]:.6g}", f"[{low:.6g}, {high:.6g}]", figure(self.mean_times[k])))
        rows.append(("none", f"{self.never:.6g}", "", ""))
        kind = "proven" if self.is_bound else "estimated"
        notes = [f"solved, not sampled: relative error {self.error:.1g}, {kind}"]
        return ResultTable(self.headline, ("target", "probability", "limits", "mean time"), rows, notes)

    def probability_bounds(self, target: str, row: int | None = None) -> tuple[float, float]:
        """Limits of the probability that a target is reached first, from the start or from state `row`."""
        k = self._index(target)
        value = float(self.probabilities[k] if row is None else self.committors[k, row])
        lost = self.lost_probability if row is None else float(self.lost[row])
        high = (value + lost) * (1.0 + self.error)
        if high < UNDERFLOW and self._may_reach(k, row):  # too small for numbers, or known to few digits
            high += UNDERFLOW
        return value * (1.0 - self.error) if value > UNDERFLOW else 0.0, min(high, 1.0)

    def _may_reach(self, k: int, row: int | None) -> bool:
        """Whether some way leads to a target, or to where the chain is lost, from state `row` or from the start."""
        leads = self.transitions.leading_to((self.committors[k] == 1.0) | (self.lost == 1.0))
        return bool(leads[self.occupation > 0.0].any() if row is None else leads[row])

    def _index(self, target: str) -> int:
        if target not in self.targets:
            raise ValueError(f"unknown target {target!r}; there are {', '.join(self.targets)}")
        return self.targets.index(target)

    def sample_entries(self, target: str, row: int, seed: int = 0, run: int = 0) -> tuple[Floats, Ints]:
        """Times (n,), tu, and places (n,) in `transitions` of the jumps of one run from state `row` until `target`.

        It is drawn from the runs that reach the target first, however few (Doob's h-transform): the chain goes from x
        to y at its rate times committor(y) / committor(x).
        """
        chances = self.committors[self._index(target)]
        if chances[row] == 0.0:
            raise ValueError(f"target {target!r} is never reached first; there are no such runs")
        return sampled_jumps(self.transitions, row, np.inf, seed, run, chances)

    def __str__(self) -> str:
        reached = zip(self.targets, self.probabilities, strict=True)
        return ", ".join([*(f"{name}: {chance:.4g}" for name, chance in reached), f"none: {self.never:.4g}"])


@dataclass(frozen=True, eq=False, repr=False)
class Committor(ChainCommittor):
    """The probabilities that each of several targets is reached first, from every state of a network.

    space : the states
    targets, committors, probabilities : K names, and the probabilities (K, N) from each state and (K,) from the start
    never, mean_times, occupation, lost, error, is_bound : as of `ChainCommittor`

    >>> from kinetics import Network, committor
    >>> turnover = Network.from_text("0 <-> A, 1, 1")
    >>> ends = {"full": lambda states: states[:, 0] == 3, "extinct": lambda states: states[:, 0] == 0}
    >>> found = committor(turnover, {"A": 1}, ends)
    >>> dict(zip(found.space.states[:, 0].tolist(), found.committors[0].round(9).tolist()))  # copies: chance of "full"
    {1: 0.25, 2: 0.5, 0: 0.0, 3: 1.0}
    >>> found.sample_path("full", seed=1).states[-1].tolist()
    [3]
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
    model: Model | Network, initial: Counts | None, targets: Mapping[str, Target], max_states: int = MAX_STATES
) -> Committor:
    """Committors of `targets`: the probability that each is reached first, from the start and from every state.

    initial : counts at time 0 that go before the model's; None for these
    targets : name -> function of states (n, S) that says which of them belong to the target (n,)
    max_states : networks with more reachable states are refused
    ValueError: no targets, a state in two of them, missing rates, or too many states

    The equations of first-step analysis (Norris 1997, doi:10.1017/CBO9780511810633, section 3.3) are solved as
    `equations` chooses, with limits relative to each figure, so that even a probability of 1e-30 has digits. The cost
    is some tens of passes over the rates for each target, or where that does not converge an elimination, states times
    the square of the band's width. Choose it where the states can be listed, and `rare_event` where they cannot.

    >>> from kinetics import Network, committor
    >>> turnover = Network.from_text("0 <-> A, 1, 1")
    >>> targets = {"extinct": lambda states: states[:, 0] == 0, "full": lambda states: states[:, 0] == 3}
    >>> found = committor(turnover, {"A": 1}, targets)
    >>> found.probabilities.round(9).tolist(), found.error < 1e-12
    ([0.75, 0.25], True)
    """
    if not (targets and isinstance(targets, Mapping) and all(map(callable, targets.values()))):
        came = f"targets are {targets!r}" if targets else "no targets"
        raise ValueError(f"{came}; give at least one, as in {{'extinct': lambda states: states[:, 0] == 0}}")

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

    given = Model.of(model, initial)
    space = reached_states(given.network, given.initial, max_states, is_target)
    start = np.eye(1, len(space))[0]
    found = committor_of(space.transitions(), start, dict(zip(targets, belongs(space.states), strict=True)))
    return Committor(**vars(found), space=space)


def committor_of(
    transitions: Transitions,
    start: Floats,
    targets: Mapping[str, NDArray[np.bool_]],
    lost: NDArray[np.bool_] | None = None,
) -> ChainCommittor:
    """The committors of any chain from a start spread as `start` (N,).

    targets : name -> states (N,), none in two; lost : states (N,) in none of them from where the chain is not followed
    """
    edge = np.zeros(start.size, dtype=bool) if lost is None else lost
    member = np.array([*targets.values(), edge])  # being lost is one more end
    is_target: NDArray[np.bool_] = np.logical_or.reduce(member)
    stopped = transitions.stopped(is_target)
    rows, columns, rates, *_ = stopped
    way = stopped.leading_to(is_target) & ~is_target
    dead, first, size = ~way & ~is_target, start[way], int(way.sum())
    committors, occupation = member.astype(float), np.zeros(start.size)
    probabilities, never = member @ start, float(start[dead].sum())
    times = np.where(probabilities > 0, 0.0, np.nan)
    error = 0.0
    if size:
        place = np.where(way, np.cumsum(way) - 1, -1)
        inside = way[rows] & way[columns]
        out = way[rows] & ~way[columns]
        here, there, gone = place[rows[out]], columns[out], rates[out]
        leaving = leaving_rates(here, gone, size)
        chain = equations(place[rows[inside]], place[columns[inside]], rates[inside], leaving, stopped.roundings)
        for k in np.flatnonzero(member.any(axis=1)):
            targeted = member[k]
            chances = chain.solved(leaving_rates(here, gone * targeted[there], size))
            committors[k, way] = np.minimum(chances.values, 1.0)
            chance, wrong = chances.mean(first)
            error = max(error, chances.relative)
            if chance > 0:
                probabilities[k] = min(probabilities[k] + chance, 1.0)
                # E[time; this end] solves the same equations with the chance of this end as what is earned.
                time, more = chain.solved(chances.values).mean(first)
                times[k] = time / probabilities[k]
                error = max(error, more + chances.relative + wrong)
        missed, wrong = chain.solved(leaving_rates(here, gone * dead[there], size)).mean(first)
        never += missed
        stays = chain.occupied(first)
        occupation[way] = stays.values
        error = 1.001 * max(error, wrong, stays.relative) + 2.0 * ROUNDOFF
        if error == np.inf:
            raise ValueError(
                f"the targets are too remote: with {size} states on the way, too many to eliminate, the chances cannot "
                f"be solved for; start nearer to the targets, or from fewer copies"
            )
    return ChainCommittor(
        stopped,
        tuple(targets),
        committors[:-1],
        probabilities[:-1],
        never,
        times[:-1],
        occupation,
        committors[-1],
        float(probabilities[-1]),
        error,
        transitions.is_certified,
    )
