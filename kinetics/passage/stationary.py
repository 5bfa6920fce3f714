"""Stationary distributions: the probabilities of the states after infinite time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network
from kinetics.passage.elimination import Elimination, TooLargeError, totals
from kinetics.passage.entry import reached_states
from kinetics.solving import StateSpace
from kinetics.solving.poisson import ROUNDOFF
from kinetics.solving.states import MAX_STATES
from kinetics.support.arrays import Floats, read_only


@dataclass(frozen=True, eq=False)
class Stationary:
    """The distribution after infinite time, starting from one state.

    probabilities : (N,) of every reachable state; 0 for transient states
    classes : for each of the C closed classes, which are never left, the rows of its states
    weights : (C,) probability of ending up in each closed class
    error : bound on the relative error of every probability down to 1e-290, rounding of the rates included; smaller
        probabilities may be lost
    """

    space: StateSpace
    probabilities: Floats
    classes: tuple[NDArray[np.intp], ...]
    weights: Floats
    error: float

    def __post_init__(self) -> None:
        for array in (self.probabilities, self.weights):
            read_only(array)

    def mean(self) -> Floats:
        """Mean counts (S,)."""
        return self.probabilities @ self.space.states

    def sd(self) -> Floats:
        """Standard deviations (S,) of the counts."""
        return np.sqrt(self.probabilities @ (self.space.states - self.mean()) ** 2)

    def marginal(self, species: str) -> Floats:
        """Probabilities (M + 1,) of 0, 1, ..., M copies of one species."""
        copies = self.space.states[:, self.space.network.index(species)]
        return totals(copies, self.probabilities, 0)

    def probability(self, state: ArrayLike) -> float:
        """Probability of one state; 0 for a state that cannot be reached."""
        row = int(self.space.index_of(self.space.network.state(state)))
        return float(self.probabilities[row]) if row >= 0 else 0.0

    def plot(self, ax: Any, species: str) -> Any:
        """Plot the distribution of the copies of one species, as steps; returns `ax`."""
        from kinetics.support import plots

        shares = self.marginal(species)
        ax.stairs(shares, np.arange(shares.size + 1) - 0.5, color=plots.COLOURS[0], fill=True, alpha=0.4)
        ax.set_xlabel(f"copies of {species}")
        ax.set_ylabel("stationary probability")
        return ax


def stationary(network: Network, initial: ArrayLike, max_states: int = MAX_STATES) -> Stationary:
    """The stationary distribution to which the chain converges from `initial`.

    max_states : networks with more reachable states, or infinitely many, are refused
    ValueError: missing rates, too many states, or a band too wide to eliminate

    It is solved by elimination without subtractions (Grassmann, Taksar & Heyman 1985, doi:10.1287/opre.33.5.1107), one
    closed class at a time; where the chain may end up in several, they are weighted by the probability of ending up in
    each. Cost: the number of states times the square of the band's width.
    """
    from scipy.sparse.csgraph import connected_components

    space = reached_states(network, initial, max_states)
    rows, columns, rates, _ = space.transitions()
    n = len(space)
    n_classes, label = connected_components(_graph(rows, columns, n), directed=True, connection="strong")
    is_closed = np.ones(n_classes, dtype=bool)
    is_closed[label[rows[label[rows] != label[columns]]]] = False
    try:
        weights, weights_error = _weights(rows, columns, rates, label, is_closed)
        probabilities, rest_error = np.zeros(n), 0.0
        classes = []
        by_class = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label))[:-1])
        for number in np.flatnonzero(is_closed):
            members = by_class[number]
            classes.append(members)
            rest, own_error = (np.ones(1), 0.0)
            if members.size > 1:
                rest, own_error = _rest_within(rows, columns, rates, members, n)
            probabilities[members] = weights[number] * rest
            rest_error = max(rest_error, own_error)
    except TooLargeError as refusal:
        raise ValueError(
            f"the stationary distribution is out of reach: {refusal}; start from fewer copies, or solve for a late time"
        ) from None
    error = weights_error + rest_error + 2.0 * ROUNDOFF * (weights_error + rest_error > 0)
    return Stationary(space, probabilities, tuple(classes), weights[is_closed], error)


def _graph(rows: NDArray[Any], columns: NDArray[Any], n: int) -> Any:
    from scipy.sparse import csr_array

    return csr_array((np.ones(rows.size), (rows, columns)), shape=(n, n))


def _weights(
    rows: NDArray[Any], columns: NDArray[Any], rates: Floats, label: NDArray[Any], is_closed: NDArray[np.bool_]
) -> tuple[Floats, float]:
    """Probability of ending up in each class, from state 0: what flows into it from states that are left for good."""
    weights = np.zeros(is_closed.size)
    if is_closed[label[0]]:
        weights[label[0]] = 1.0
        return weights, 0.0
    passing = np.flatnonzero(~is_closed[label])
    place = np.full(label.size, -1)
    place[passing] = np.arange(passing.size)
    inside = (place[rows] >= 0) & (place[columns] >= 0)
    out = (place[rows] >= 0) & (place[columns] < 0)
    leaving = totals(place[rows[out]], rates[out], passing.size)
    chain = Elimination(place[rows[inside]], place[columns[inside]], rates[inside], leaving)
    times = chain.occupation(np.eye(1, passing.size)[0])
    weights += totals(label[columns[out]], times[place[rows[out]]] * rates[out], weights.size)
    return weights, chain.error


def _rest_within(
    rows: NDArray[Any], columns: NDArray[Any], rates: Floats, members: NDArray[np.intp], n: int
) -> tuple[Floats, float]:
    """Stationary distribution of one closed class."""
    place = np.full(n, -1)
    place[members] = np.arange(members.size)
    inside = place[rows] >= 0
    chain = Elimination(place[rows[inside]], place[columns[inside]], rates[inside], np.zeros(members.size))
    return chain.stationary(), chain.error
