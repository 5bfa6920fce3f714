"""A prediction job: counts of a network, or sums of these, from a start at some times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Model, Network
from kinetics.predicting.observables import Observables
from kinetics.sampling.watch import MAX_EVENTS
from kinetics.support.arrays import Floats, some_times
from kinetics.support.frozen import set_fields

if TYPE_CHECKING:
    from kinetics.markov.transient import Distribution


@dataclass(frozen=True, eq=False)
class Job:
    """Counts of a model at `grid` (T,), tu, or `observables` of them, and how runs are made.

    seed, threads, max_events : of runs, see `simulate`
    report : called with a line of text on how far the work is
    trajectories : number of single runs to sample next to the prediction, see `sample_trajectories`

    >>> from kinetics import Model, Network
    >>> from kinetics.predicting import Job
    >>> Job(Model(Network.from_text("A <-> B, 1, 1"), {"A": 3}), [1.0, 2.0]).is_known.any()
    np.False_
    """

    model: Model
    grid: Floats
    observables: Observables | None = None
    seed: int = 0
    threads: int | None = None
    report: Callable[[str], None] = lambda _: None
    max_events: int = MAX_EVENTS
    trajectories: int = 0

    def __post_init__(self) -> None:
        set_fields(self, grid=some_times(self.grid))

    @property
    def shown(self) -> Network:
        """The network whose counts the prediction gives: that of the observables, if there are any."""
        return self.model.network if self.observables is None else self.observables.network

    def distribution(self, found: Distribution) -> Distribution:
        """The distribution of what is shown, from that of all counts."""
        return found if self.observables is None else self.observables.of_distribution(found)

    def bounds(self, tops: Floats) -> Floats:
        """Upper bounds (V,) of what is shown, from those (S,) of the counts."""
        if self.observables is None:
            return tops
        weights = self.observables.weights
        return np.asarray((weights * np.where(weights > 0, tops[:, None], 0.0)).sum(axis=0))

    @property
    def is_known(self) -> NDArray[np.bool_]:
        """Which figures (T, V) have no random error: all at time 0, and at any time those that nothing changes."""
        network = self.model.network
        moves: NDArray[np.bool_] = np.bincount(network.sparse_stoichiometry.columns, minlength=len(network.species)) > 0
        for event in network.events:
            moves[[network.index(name) for name in event.assign]] = True
        if self.observables is not None:
            moves = np.any(self.observables.weights[moves] > 0, axis=0)
        return np.equal(self.grid, 0.0)[:, None] | ~moves
