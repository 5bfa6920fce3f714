"""Stationary distributions: the probabilities of the states after infinite time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.certified import BoundedSolution, Equations, leaving_rates
from kinetics.markov.passage.elimination import MAX_FACTORED, Elimination, SparseFactors, TooLargeError, work_of
from kinetics.markov.passage.equations import equations, is_easy
from kinetics.markov.passage.iteration import Iteration
from kinetics.markov.passage.until import UNDERFLOW
from kinetics.markov.transient import StateSpace, Transitions
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import totals
from kinetics.native import linear
from kinetics.native.rate_tables import RateTable, connected_classes
from kinetics.support import plots
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Counts, Floats, read_only
from kinetics.support.datasets import dataframe
from kinetics.support.packages import pd
from kinetics.support.shown import ResultTable, Shown, Tabular, on_axes

MOST_CLASSES = 10  # in a table for people
MANY = 20_000  # states on which sparse factors are tried before elimination
ROUGH = 1e-3  # an error that is told rather than refused
FINE = 1e-12  # an error known beforehand that needs no proof afterwards
CLOSE = 1e-9  # one proven afterwards that needs no other way
ANCHORS = 3  # that are tried
ALIKE = 8.0  # times as likely: no better anchor
Solver = TypeVar("Solver", bound=Equations)
SMALLEST = 5e-324
LOST = 1e-291  # what is smaller may be
LOWEST = -600.0  # logarithm of the smallest guess


@dataclass(frozen=True, eq=False, repr=False)
class Stationary(Shown, Tabular):
    """The distribution of a chain after infinite time; of a network, also by species.

    probabilities : (N,) of every state; 0 for transient states and those that are not reached
    classes : for each of the C closed classes, which are never left, the rows of its states
    weights : (C,) probability of ending up in each closed class
    error : relative error of every probability down to 1e-290, rounding of the rates included; smaller probabilities
        may be lost
    is_bound : whether the error is proven; not by a rate law that cannot be bounded
    space : the states of the network behind the chain, if there is one; ValueError if counts are asked for without

    >>> from kinetics import Network, stationary
    >>> found = stationary(Network.from_text("A <-> B, 2, 3"), {"A": 2})
    >>> found.mean().round(9).tolist(), found.sd().round(6).tolist(), round(found.probability({"A": 2}), 9)
    ([1.2, 0.8], [0.69282, 0.69282], 0.36)
    """

    probabilities: Floats
    classes: tuple[NDArray[np.intp], ...]
    weights: Floats
    error: float
    is_bound: bool
    space: StateSpace | None = None

    def __post_init__(self) -> None:
        for array in (self.probabilities, self.weights):
            read_only(array)

    @property
    def headline(self) -> str:
        """The number of states of the distribution, on one line."""
        classes = "1 closed class" if len(self.classes) == 1 else f"{len(self.classes)} closed classes"
        return f"stationary distribution of {self.probabilities.size} states, {classes}"

    def summary(self) -> ResultTable:
        """Mean and standard deviation of every species; of a chain without species, the likeliest closed classes."""
        notes = [f"solved, not sampled: relative error of a probability {self.error:.1g}, {kind_of(self.is_bound)}"]
        if self.space is None:
            order = np.argsort(-self.weights, kind="stable")[:MOST_CLASSES]
            classes = [(str(c + 1), f"{self.weights[c]:.6g}", str(len(self.classes[c]))) for c in order]
            return ResultTable(self.headline, ("closed class", "probability", "states"), classes, notes)
        columns = zip(self.space.network.species, self.mean(), self.sd(), strict=True)
        rows = [(name, f"{mean:.6g}", f"{sd:.4g}") for name, mean, sd in columns]
        return ResultTable(self.headline, ("species", "mean", "sd"), rows, notes)

    @property
    def _space(self) -> StateSpace:
        if self.space is None:
            raise ValueError("this chain comes from no network, so its states have no counts; use probabilities")
        return self.space

    def mean(self) -> Floats:
        """Mean counts (S,)."""
        return self.probabilities @ self._space.states

    def sd(self) -> Floats:
        """Standard deviations (S,) of the counts."""
        return np.sqrt(self.probabilities @ (self._space.states - self.mean()) ** 2)

    def marginal(self, species: str) -> Floats:
        """Probabilities (M + 1,) of 0, 1, ..., M copies of one species."""
        copies = self._space.states[:, self._space.network.index(species)]
        return totals(copies, self.probabilities, 0)

    def probability(self, state: Counts) -> float:
        """Probability of these counts: of one state where all S are given, else summed over the unnamed species.

        0 for states that cannot be reached. ValueError: an unknown species
        """
        return float(self.probabilities[self._space.rows_with(state)].sum())

    def to_dataframe(self) -> pd.DataFrame:
        """One row per species and number of copies: its probability."""
        shares = {name: self.marginal(name) for name in self._space.network.species}
        keys = {
            "species": np.repeat(list(shares), [share.size for share in shares.values()]),
            "copies": np.concatenate([np.arange(share.size) for share in shares.values()]),
        }
        return dataframe(keys | {"probability": np.concatenate(list(shares.values()))})

    @on_axes
    def plot(self, ax: Any, species: str | None = None) -> Any:
        """Plot the distribution of the copies of one species, or of each, as steps; returns `ax`."""
        names = self._space.network.species if species is None else (species,)
        for name in names:
            shares = self.marginal(name)
            edges = np.arange(shares.size + 1) - 0.5
            shade = {"color": plots.colour(self._space.network.index(name))}
            ax.stairs(shares, edges, label=name, fill=len(names) == 1, alpha=0.4 if len(names) == 1 else 1.0, **shade)
        ax.set_xlabel(f"copies of {names[0]}" if len(names) == 1 else "copies")
        ax.set_ylabel("stationary probability")
        if len(names) > 1:
            ax.legend(frameon=False)
        return ax


def stationary_of(transitions: Transitions, start: Floats) -> Stationary:
    """The stationary distribution of any chain from a start spread as `start` (N,)."""
    rows, columns, *_ = transitions
    n = transitions.size
    n_classes, label = connected_classes(rows, columns, n)
    is_closed = np.ones(n_classes, dtype=bool)
    is_closed[label[rows[label[rows] != label[columns]]]] = False
    try:
        weights, weights_error = _weights(transitions, start, label, is_closed)
        probabilities, rest_error = np.zeros(n), 0.0
        classes = []
        by_class = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])
        is_reached = is_closed & (weights > 0)
        for number in np.flatnonzero(is_reached):
            members = by_class[number]
            classes.append(members)
            rest, own_error = (np.ones(1), 0.0)
            if members.size > 1:
                rest, own_error = _rest_within(transitions, members)
            probabilities[members] = weights[number] * rest
            rest_error = max(rest_error, own_error)
    except TooLargeError as refusal:
        raise ValueError(
            f"the stationary distribution is out of reach: {refusal}; start from smaller counts or solve for a late "
            f"time"
        ) from None
    error = weights_error + rest_error + 2.0 * ROUNDOFF * (weights_error + rest_error > 0)
    return Stationary(probabilities, tuple(classes), weights[is_reached], error, transitions.is_certified)


def steady_mean(rest: Stationary, values: Floats) -> Answer:
    """Mean of values (N,), none negative, after infinite time."""
    value, error = float(rest.probabilities @ values), rest.error + ROUNDOFF * (values.size + 1)
    # of states that are held in the steady state, however rarely
    lost = UNDERFLOW * sum(float(values[members].sum()) for members in rest.classes)
    return Answer.within(value, error, rest.is_bound, lost)


def _weights(
    transitions: Transitions, start: Floats, label: NDArray[Any], is_closed: NDArray[np.bool_]
) -> tuple[Floats, float]:
    """Probability of ending up in each class: what begins there, and what flows in from states that are left for good.

    With a bound on the relative error.
    """
    is_passing = ~is_closed[label]
    weights = totals(label, np.where(is_passing, 0.0, start), is_closed.size)
    if not start[is_passing].any():
        return weights, ROUNDOFF * int(np.count_nonzero(start) - 1)
    passing = np.flatnonzero(is_passing & transitions.reached_from(start > 0))
    rows, columns, rates, *_ = transitions
    place = np.full(label.size, -1)
    place[passing] = np.arange(passing.size)
    inside = (place[rows] >= 0) & (place[columns] >= 0)
    out = (place[rows] >= 0) & (place[columns] < 0)
    leaving = leaving_rates(place[rows[out]], rates[out], passing.size)
    inner = place[rows[inside]], place[columns[inside]], rates[inside]
    chain = equations(*inner, leaving, transitions.roundings)
    times = chain.occupied(start[passing])
    weights += totals(label[columns[out]], times.values[place[rows[out]]] * rates[out], weights.size)
    entered = np.bincount(label[columns[out]], minlength=weights.size) > 0
    weights[entered] = np.maximum(weights[entered], SMALLEST)  # however unlikely
    # the flows in are added up
    terms = 2.0 * int(np.count_nonzero(start) - 1) + int(out.sum()) + 1
    return weights, times.relative + ROUNDOFF * terms


def _rest_within(transitions: Transitions, members: NDArray[np.intp]) -> tuple[Floats, float]:
    """Stationary distribution of one closed class."""
    rows, columns, rates, *_ = transitions
    place = np.full(transitions.size, -1)
    place[members] = np.arange(members.size)
    inside = place[rows] >= 0
    nowhere = np.zeros(members.size)
    inner = Transitions(place[rows[inside]], place[columns[inside]], rates[inside], nowhere, transitions.roundings)
    easy = is_easy(inner.rows, inner.columns, inner.size)
    if not easy:
        iterated = _by_iteration(inner)
        if iterated[1] <= CLOSE:
            return iterated
    tried = not easy and inner.size <= MANY and work_of(inner.rows, inner.columns, inner.size) <= MAX_FACTORED
    factored = _by_factors(inner) if tried else None
    if factored is not None and factored[1] <= CLOSE:
        return factored
    try:
        chain = Elimination(*inner[:5])
    except TooLargeError as refusal:
        if factored is None and refusal.work > MAX_FACTORED:
            if not easy and iterated[1] < ROUGH:
                return iterated
            raise
        found, error = factored or _by_factors(inner)
        if not error < ROUGH:
            raise
        return found, error
    found = chain.stationary()
    if chain.error <= FINE:
        return found, chain.error
    better, error = _between_visits(Elimination, inner, int(np.argmax(found)))
    return (better, error) if error < chain.error else (found, chain.error)


def _by_iteration(chain: Transitions) -> tuple[Floats, float]:
    """Solve between visits to a likely state: first a guessed one, then the likeliest of a rough solution."""
    guess = _guessed(chain)
    for _ in range(ANCHORS):
        anchor = int(np.argmax(guess))
        inner, into = _around(Iteration, chain, anchor)
        with np.errstate(all="ignore"):
            guess = np.insert(inner.about(into, np.delete(guess, anchor) / guess[anchor]), anchor, 1.0)
        if guess.max() <= ALIKE:
            break
    return _normalised(inner.occupied(into, np.delete(guess, anchor)), anchor)


def _guessed(chain: Transitions) -> Floats:
    """About the probabilities (N,), times some number."""
    table = RateTable.of(chain.rows, chain.columns, chain.rates, chain.size)
    logs = np.empty(chain.size)
    linear.balanced(table, chain.exits, logs)
    return np.exp(np.maximum(logs - float(logs.max()), LOWEST))


def _by_factors(chain: Transitions) -> tuple[Floats, float]:
    """Solve between visits to a likely state: first the one where the likeliest jumps end, then the likeliest."""
    fastest = np.lexsort((chain.rates, chain.rows))
    last = np.append(np.flatnonzero(np.diff(chain.rows[fastest])), chain.rows.size - 1)
    likeliest = chain.columns[fastest[last]]
    anchor = 0
    for _ in range(chain.size):
        anchor = int(likeliest[anchor])
    for _ in range(ANCHORS):
        found, error = _between_visits(SparseFactors, chain, anchor)
        if error <= CLOSE or np.argmax(found) == anchor:
            break
        anchor = int(np.argmax(found))
    return found, error


def _between_visits(solver: type[Equations], chain: Transitions, anchor: int) -> tuple[Floats, float]:
    """The distribution as time spent in each state between two visits to one, with an error proven afterwards."""
    inner, into = _around(solver, chain, anchor)
    with np.errstate(all="ignore"):  # of a state so unlikely that the others are beyond all numbers
        return _normalised(inner.occupied(into), anchor)


def _around(solver: type[Solver], chain: Transitions, anchor: int) -> tuple[Solver, Floats]:
    """The equations of all states but one, and how often each is entered (N - 1,) in a time unit there."""
    rows, columns, rates, *_ = chain
    n, states = chain.size, np.arange(chain.size)
    place = states - (states > anchor)
    begins, inside, ends = rows == anchor, (rows != anchor) & (columns != anchor), columns == anchor
    leaving = leaving_rates(place[rows[ends]], rates[ends], n - 1)
    inner = solver(place[rows[inside]], place[columns[inside]], rates[inside], leaving, chain.roundings)
    return inner, leaving_rates(place[columns[begins]], rates[begins], n - 1)


def _normalised(stays: BoundedSolution, anchor: int) -> tuple[Floats, float]:
    """Probabilities (N,) from the time in all states but one, where that is 1; and a bound on their error."""
    found = np.insert(stays.values, anchor, 1.0)
    with np.errstate(all="ignore"):
        total = float(found.sum())
        if not total > 0.0:  # from a solution that failed
            return found, np.inf
        relative = stays.relative_above(LOST * total) + float(stays.errors.sum()) / total
        error = 1.001 * (relative + ROUNDOFF * (found.size + 2))
        return found / total, float(np.nan_to_num(error, nan=np.inf, posinf=np.inf))
