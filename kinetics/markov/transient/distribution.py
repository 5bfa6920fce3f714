"""The result of a solving method: the probability of every state at each time, with its error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from kinetics.markov.transient.states import StateSpace
from kinetics.network import Network
from kinetics.support import plots
from kinetics.support.arrays import Counts, Floats, read_only
from kinetics.support.datasets import dataframe_over_times, dataset
from kinetics.support.packages import pd
from kinetics.support.shown import RUN_SPREAD, ResultTable, Shown, Tabular, means_over_time, on_axes

if TYPE_CHECKING:
    import xarray as xr

SLACK = 2.0**-52  # by which a sum of probabilities may miss a quantile


@dataclass(frozen=True, eq=False, repr=False)
class Distribution(Shown, Tabular):
    """The probability of every state at each time, with its error.

    times : (T,) tu
    probabilities : (T, N), none negative
    error : bound on the absolute error summed over all states, at any time, from truncation, rounding, and the rounding
        of the rates
    is_bound : whether `error` is a proven bound; otherwise it is an estimate, as by a rate law that cannot be bounded
    is_complete : whether the space holds all reachable states; otherwise the missing probability is at most `error`

    >>> from kinetics import Network, solve
    >>> found = solve(Network.from_text("A -> 0, 0.1"), "transient", {"A": 2}, [10.0])
    >>> found.marginal("A").round(6).tolist()  # binomial, with probability 1/e
    [[0.399576, 0.465088, 0.135335]]
    >>> low, high = found.probability_bounds({"A": 2})
    >>> bool(high[0] - low[0] < 1e-12)
    True
    """

    space: StateSpace
    times: Floats
    probabilities: Floats
    error: float
    is_bound: bool = True
    is_complete: bool = True
    runs: ClassVar[None] = None
    is_interrupted: ClassVar[bool] = False
    truncated: ClassVar[None] = None
    meaning: ClassVar[str] = RUN_SPREAD
    approximation: ClassVar[None] = None
    no_interval: ClassVar[str] = ""
    notes: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        expected = (self.times.size, len(self.space))
        if self.probabilities.shape != expected:
            raise ValueError(f"probabilities have shape {self.probabilities.shape}; expected {expected}")
        read_only(self.probabilities)

    @property
    def network(self) -> Network:
        """The network whose states these are."""
        return self.space.network

    @property
    def headline(self) -> str:
        """One line: the numbers of states and times."""
        return f"probabilities of {len(self.space)} states at {self.times.size} times"

    def summary(self) -> ResultTable:
        """Mean and standard deviation of the counts, at some of the times."""
        kind = "proven" if self.is_bound else "estimated"
        note = f"mean ± sd; solved, not sampled: error of all probabilities together {self.error:.1g}, {kind}"
        network = self.network
        return means_over_time(
            self.headline, self.times, network.time_unit, network.species, self.mean(), self.sd(), note
        )

    def mean(self) -> Floats:
        """Mean counts (T, S)."""
        return self.probabilities @ self.space.states

    def mean_bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the mean counts (T, S); no upper bound (inf) where the space is not complete."""
        mean, top = self.mean(), self.space.states.max(axis=0)
        # At worst all of the error is on the largest count; and a sum of N positive terms rounds.
        slack = (self.error + SLACK * len(self.space)) * top
        return np.maximum(mean - slack, 0.0), mean + (slack if self.is_complete else np.inf)

    def sd(self) -> Floats:
        """Standard deviations (T, S) of the counts."""
        columns = zip(self.space.states.T, self.mean().T, strict=True)
        # About the mean: the difference of two large squares would lose the small variances.
        variances: list[Floats] = [((x - mean[:, None]) ** 2 * self.probabilities).sum(axis=1) for x, mean in columns]
        return np.sqrt(np.stack(variances, axis=1))

    def covariance(self) -> Floats:
        """Covariances (T, S, S) of the counts, about the mean as in `sd`."""
        away = (self.space.states - mean for mean in self.mean())
        return np.stack([(x.T * p) @ x for x, p in zip(away, self.probabilities, strict=True)])

    def marginal(self, species: str) -> Floats:
        """Probabilities (T, M + 1) of 0, 1, ..., M copies of one species."""
        copies = self.space.states[:, self.network.index(species)]
        table = np.zeros((self.times.size, int(copies.max()) + 1))
        for row, weights in zip(table, self.probabilities, strict=True):
            row[:] = np.bincount(copies, weights, minlength=row.size)
        return table

    def probability(self, state: Counts) -> Floats:
        """Probability (T,) of these counts: of one state where all S are given, else summed over the unnamed species.

        0 for states that are not in the space. ValueError: an unknown species

        >>> from kinetics import Network, solve
        >>> found = solve(Network.from_text("A <-> B, 1, 1"), "transient", {"A": 1, "B": 1}, [100.0])
        >>> found.probability({"A": 1}).round(6).tolist(), found.probability([1, 0]).round(6).tolist()
        ([0.5], [0.0])
        """
        return np.asarray(self.probabilities[:, self.space.rows_with(state)].sum(axis=1))

    def probability_bounds(self, state: Counts) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the probability (T,) of these counts, as `probability` reads them."""
        rows = self.space.rows_with(state)
        value = self.probabilities[:, rows].sum(axis=1)
        slack = self.error + SLACK * max(rows.size - 1, 0)  # a sum of n positive terms rounds n - 1 times
        return np.maximum(value - slack, 0.0), np.minimum(value + slack, 1.0)

    def quantile(self, q: float) -> Floats:
        """Quantiles (T, S): the smallest counts with a probability of at least q at or below them."""
        if not 0 <= q <= 1:
            raise ValueError(f"q = {q}; expected a probability")
        columns = []
        for species in self.network.species:
            below = np.cumsum(self.marginal(species), axis=1)
            columns.append((below < q - self.error - SLACK).sum(axis=1))
        return np.asarray(np.minimum(np.stack(columns, axis=1), self.space.states.max(axis=0)), dtype=np.float64)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per time and species: mean and standard deviation of the counts."""
        figures = {"mean": self.mean(), "sd": self.sd()}
        return dataframe_over_times(self.times, "species", self.network.species, figures)

    def to_xarray(self) -> xr.Dataset:
        """Mean, its bounds, and sd, with dimensions time and species; the probability of each number of copies."""
        low, high = self.mean_bounds()
        figures = {"mean": self.mean(), "low": low, "high": high, "sd": self.sd()}
        variables: dict[str, Any] = {name: (("time", "species"), values) for name, values in figures.items()}
        names, most = self.network.species, int(self.space.states.max())
        chances = np.zeros((self.times.size, len(names), most + 1))
        for s, name in enumerate(names):
            marginal = self.marginal(name)
            chances[:, s, : marginal.shape[1]] = marginal
        variables["probability"] = (("time", "species", "copies"), chances)
        places = {"time": self.times, "species": list(names), "copies": np.arange(most + 1)}
        return dataset(variables, places, self.network.time_unit, error=self.error, is_bound=int(self.is_bound))

    def standard_error(self) -> Floats:
        """Zeros (T, S): it was solved, not sampled."""
        return np.zeros((self.times.size, len(self.network.species)))

    def precision(self, _standard_error: Floats) -> str:
        """How well the means are known, in a few words."""
        return f"numerical error of the probabilities below {self.error:.1g}"

    def columns(self, standard_error: Floats) -> dict[str, Floats]:
        """Mean, sd and standard error (T, S) for a table of a prediction."""
        return {"mean": self.mean(), "sd": self.sd(), "standard_error": standard_error}

    def bands(self) -> plots.Bands:
        """Means and the middle 95 % of the probability."""
        return plots.Bands(self.times, self.mean(), self.quantile(0.025), self.quantile(0.975))

    def approximate(self) -> None:
        """None: nothing is approximated."""

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Plot the means, with bands of the middle 95 % of the probability; returns `ax`."""
        return plots.bands(ax, *self.bands(), self.network.species, self.network.time_unit)
