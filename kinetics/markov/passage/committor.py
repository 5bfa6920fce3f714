"""Committors: which of several targets a chain reaches first, when, through which states, and along which paths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.certified import leaving_rates
from kinetics.markov.passage.equations import equations
from kinetics.markov.passage.sampled import sampled_jumps
from kinetics.markov.passage.until import UNDERFLOW
from kinetics.markov.transient import StateSpace, Transitions
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.runs import JumpPath
from kinetics.support.answer import kind_of
from kinetics.support.arrays import Floats, Ints, read_only
from kinetics.support.shown import ResultTable, Shown
from kinetics.support.tables import figure


@dataclass(frozen=True, eq=False, repr=False)
class Committor(Shown):
    """The probabilities that each of several targets is reached first, from every state of a chain.

    transitions : of the chain, which stops in the targets
    targets : K names
    committors : (K, N) probability that each target is reached first, from each state
    probabilities : (K,) probability that each target is reached first, from the start
    never : probability of reaching none, that is, of entering states from which no target can be reached
    mean_times : (K,) mean time, tu, of the runs that reach each target first; nan if none does
    occupation : (N,) expected time, tu, in each state until a target is reached or none can be reached any more
    truncated : (N,) probability of leaving a truncated chain before any target, from each state; all else is then of
        the runs that do not, so that each committor lies between `committors` and `committors + truncated`
    truncated_probability : probability of leaving it, from the start
    error : relative error of all of these, rounding of the rates included; probabilities below 1e-290 may be lost
    is_bound : whether the error is proven; not by a rate law that cannot be bounded
    space : the states of the network behind the chain, if there is one

    >>> from kinetics import Network, committor
    >>> found = committor(Network.from_text("0 <-> A, 1, 1"), {"A": 1}, {"full": "A == 3", "extinct": "A == 0"})
    >>> dict(zip(found.space.states[:, 0].tolist(), found.committors[0].round(9).tolist()))  # counts: chance of "full"
    {1: 0.25, 2: 0.5, 0: 0.0, 3: 1.0}
    >>> found.sample_path("full", seed=1).states[-1].tolist()
    [3]
    """

    transitions: Transitions
    targets: tuple[str, ...]
    committors: Floats
    probabilities: Floats
    never: float
    mean_times: Floats
    occupation: Floats
    truncated: Floats
    truncated_probability: float
    error: float
    is_bound: bool
    space: StateSpace | None = None

    def __post_init__(self) -> None:
        for array in (self.committors, self.probabilities, self.mean_times, self.occupation, self.truncated):
            read_only(array)

    @property
    def headline(self) -> str:
        """Which target is reached first, and how often."""
        return f"reached first: {self}; {self.occupation.size} states"

    def summary(self) -> ResultTable:
        """Probability with bounds and mean time of each target."""
        rows = []
        for k, name in enumerate(self.targets):
            low, high = self.probability_bounds(name)
            rows.append((name, f"{self.probabilities[k]:.6g}", f"[{low:.6g}, {high:.6g}]", figure(self.mean_times[k])))
        rows.append(("none", f"{self.never:.6g}", "", ""))
        notes = [f"solved, not sampled: relative error {self.error:.1g}, {kind_of(self.is_bound)}"]
        return ResultTable(self.headline, ("target", "probability", "bounds", "mean time"), rows, notes)

    def probability_bounds(self, target: str, row: int | None = None) -> tuple[float, float]:
        """Bounds of the probability that a target is reached first, from the start or from state `row`."""
        k = self._index(target)
        value = float(self.probabilities[k] if row is None else self.committors[k, row])
        outside = self.truncated_probability if row is None else float(self.truncated[row])
        high = (value + outside) * (1.0 + self.error)
        if high < UNDERFLOW and self._may_reach(k, row):  # too small for numbers, or known to few digits
            high += UNDERFLOW
        return value * (1.0 - self.error) if value > UNDERFLOW else 0.0, min(high, 1.0)

    def _may_reach(self, k: int, row: int | None) -> bool:
        """True if a target, or the edge of a truncated chain, can be reached from state `row` or from the start."""
        coreachable = self.transitions.leading_to((self.committors[k] == 1.0) | (self.truncated == 1.0))
        return bool(coreachable[self.occupation > 0.0].any() if row is None else coreachable[row])

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

    def sample_path(self, target: str, seed: int = 0, run: int = 0) -> JumpPath:
        """One run of a network until `target`, drawn from the runs that reach it first: see `sample_entries`."""
        if self.space is None:
            raise ValueError("this chain comes from no network, so its runs have no counts; use sample_entries")
        times, entries = self.sample_entries(target, 0, seed, run)
        channels = np.asarray(self.transitions.channels)[entries]
        end = float(times[-1]) if times.size else 0.0
        return JumpPath(self.space.network, self.space.states[0], times, channels, end)

    def __str__(self) -> str:
        reached = zip(self.targets, self.probabilities, strict=True)
        return ", ".join([*(f"{name}: {chance:.4g}" for name, chance in reached), f"none: {self.never:.4g}"])


def check_targets(targets: object) -> None:
    """A ValueError if targets are no mapping, or none."""
    if not (targets and isinstance(targets, Mapping)):
        came = f"targets are {targets!r}" if targets else "no targets"
        raise ValueError(f"{came}; give at least one, as in {{'extinct': 'A == 0'}}")


def committor_of(
    transitions: Transitions,
    start: Floats,
    targets: Mapping[str, NDArray[np.bool_]],
    truncated: NDArray[np.bool_],
) -> Committor:
    """The committors of any chain from a start spread as `start` (N,).

    targets : name -> states (N,), none in two; truncated : states (N,) in none of them at the edge of the chain
    """
    member = np.array([*targets.values(), truncated])  # leaving the chain is one more end
    is_target: NDArray[np.bool_] = np.logical_or.reduce(member)
    stopped = transitions.stopped(is_target)
    rows, columns, rates, *_ = stopped
    transient = stopped.leading_to(is_target) & ~is_target
    dead, first, size = ~transient & ~is_target, start[transient], int(transient.sum())
    committors, occupation = member.astype(float), np.zeros(start.size)
    probabilities, never = member @ start, float(start[dead].sum())
    times = np.where(probabilities > 0, 0.0, np.nan)
    error = 0.0
    if size:
        place = np.where(transient, np.cumsum(transient) - 1, -1)
        inside = transient[rows] & transient[columns]
        out = transient[rows] & ~transient[columns]
        here, there, gone = place[rows[out]], columns[out], rates[out]
        leaving = leaving_rates(here, gone, size)
        chain = equations(place[rows[inside]], place[columns[inside]], rates[inside], leaving, stopped.roundings)
        for k in np.flatnonzero(member.any(axis=1)):
            targeted = member[k]
            chances = chain.solved(leaving_rates(here, gone * targeted[there], size))
            committors[k, transient] = np.minimum(chances.values, 1.0)
            chance, wrong = chances.mean(first)
            error = max(error, chances.relative)
            if chance > 0:
                probabilities[k] = min(probabilities[k] + chance, 1.0)
                # E[time; this end] solves the equations with the chance of this end as the reward rate.
                time, more = chain.solved(chances.values).mean(first)
                times[k] = time / probabilities[k]
                error = max(error, more + chances.relative + wrong)
        missed, wrong = chain.solved(leaving_rates(here, gone * dead[there], size)).mean(first)
        never += missed
        stays = chain.occupied(first)
        occupation[transient] = stays.values
        error = 1.001 * max(error, wrong, stays.relative) + 2.0 * ROUNDOFF
        if error == np.inf:
            raise ValueError(
                f"the targets are too remote: with {size} transient states, too many to eliminate, the "
                f"probabilities cannot be solved; start nearer to the targets or from smaller counts"
            )
    return Committor(
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
