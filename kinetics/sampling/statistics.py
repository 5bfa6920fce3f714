"""Statistics of ensembles in constant memory, however many runs there are.

All that is kept are whole numbers: histograms, sums, sums of products, in integers that cannot overflow. So the
statistics of a set of runs do not depend on the blocks in which they came, on their order, or on who made them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics import kernels
from kinetics.native import twins
from kinetics.network import Network
from kinetics.runs.truncation import Truncation
from kinetics.sampling.marginal import Marginal
from kinetics.support import plots
from kinetics.support.arrays import Floats, Ints, read_only, rising_times
from kinetics.support.datasets import dataframe_over_times, dataset
from kinetics.support.intervals import binomial_limits
from kinetics.support.memory import check_memory
from kinetics.support.packages import pd
from kinetics.support.shown import RUN_SPREAD, ResultTable, Shown, Tabular, means_over_time, on_axes, precision_of

if TYPE_CHECKING:
    import xarray as xr

# Bins of a histogram, one for each time and species. No power of two: histograms so many bytes apart would push each
# other out of the cache.
MOST_BINS, FEWEST_BINS = 4088, 63
HISTOGRAM_BYTES = 2**28  # of all histograms, as long as there are more than the fewest bins
MOST_COVARIED = 32  # species up to which all pairs are kept; their number grows with the square
LARGEST_SQUARE = 2**62
QUANTILES = (0.025, 0.5, 0.975)  # of tables
Exact = NDArray[np.object_]  # whole numbers without limit


@dataclass(frozen=True, eq=False, repr=False)
class EnsembleStatistics(Shown, Tabular):
    """Statistics of the counts of many independent runs on one grid of times; the runs are not kept.

    times : (T,) tu, rising
    runs, asked : numbers of runs made and requested; fewer are made after Ctrl-C
    low, high : (T, S) smallest and largest counts seen
    shift, origin, histogram : numbers of runs (T, S, bins) in bins of 2**shift counts (T, S), the first of which is
        number `origin`. Bins are one count wide where the range allows, and then nothing is rounded
    sums, products : exact integers: sums of the counts (T, S), and of the products of each pair of species (T, P)
    pairs : (2, P) the species of the pairs
    method : that made the runs; "" if that is not known
    truncated : why there are fewer times than were asked for; None if there are not

    >>> from kinetics import Network, simulate_statistics
    >>> source = Network.from_text("0 -> A, 5")
    >>> statistics = simulate_statistics(source, "ssa", {"A": 0}, [1.0], runs=2000, seed=1)
    >>> statistics.runs, statistics.quantile(0.5).tolist()  # of a Poisson distribution of mean 5
    (2000, [[5.0]])
    """

    network: Network
    times: Floats
    runs: int
    asked: int
    low: Ints
    high: Ints
    shift: Ints
    origin: Ints
    histogram: Ints
    sums: Exact
    products: Exact
    pairs: NDArray[np.intp]
    method: str = ""
    truncated: Truncation | None = None
    error: ClassVar[float] = 0.0  # numerical, of probabilities: shares of runs have none
    meaning: ClassVar[str] = RUN_SPREAD
    approximation: ClassVar[None] = None
    no_interval: ClassVar[str] = ""

    @property
    def is_complete(self) -> bool:
        """Whether all requested runs were made."""
        return self.runs == self.asked

    @property
    def is_interrupted(self) -> bool:
        """Whether fewer runs were made than were asked for."""
        return not self.is_complete

    @property
    def notes(self) -> tuple[str, ...]:
        """Why times are missing, and how far quantiles may be off, if they are."""
        off = int(self.quantile_error().max())
        cut = () if self.truncated is None else (str(self.truncated),)
        return (*cut, f"the middle 95 % of the runs is known to {off} copies") if off else cut

    @property
    def headline(self) -> str:
        """How much it holds."""
        made = str(self.runs) if self.is_complete else f"{self.runs} of {self.asked}"
        size = f"statistics of {made} runs of {len(self.network.species)} species at {self.times.size} times"
        return f"{size}; method {self.method}" if self.method else size

    def summary(self) -> ResultTable:
        """Mean and standard deviation of a run, at some of the times."""
        note = f"mean ± sd of a run; {precision_of(self.standard_error())}"
        if self.truncated is not None:
            note += f"; {self.truncated}"
        network = self.network
        return means_over_time(
            self.headline, self.times, network.time_unit, network.species, self.mean(), self.sd(), note
        )

    def mean(self) -> Floats:
        """Mean counts (T, S), rounded once."""
        return np.asarray(self.sums / self.runs, dtype=np.float64)

    def variance(self) -> Floats:
        """Variance (T, S) among the runs, with runs - 1, rounded once; nan for a single run."""
        return self._covariances(np.flatnonzero(self.pairs[0] == self.pairs[1]))

    def sd(self) -> Floats:
        """Standard deviation (T, S) among the runs, with runs - 1; nan for a single run."""
        return np.sqrt(self.variance())

    def standard_error(self) -> Floats:
        """Standard error (T, S) of the mean; nan for a single run."""
        return self.sd() / math.sqrt(self.runs)

    def covariance(self) -> Floats:
        """Covariances (T, S, S) of the species at each time, with runs - 1, rounded once; nan for a single run."""
        n_species = len(self.network.species)
        first, second = self.pairs
        if first.size < n_species * (n_species + 1) // 2:
            raise ValueError(
                f"the network has {n_species} species; covariances are kept by default for up to {MOST_COVARIED}: "
                f"request them when the runs are made, by covariances=True"
            )
        table = np.empty((self.times.size, n_species, n_species))
        table[:, first, second] = table[:, second, first] = self._covariances(np.arange(first.size))
        return table

    def _covariances(self, asked: NDArray[np.intp]) -> Floats:
        """(T, K) of some of the pairs that are kept."""
        if self.runs == 1:
            return np.full((self.times.size, asked.size), np.nan)
        return covariances_of(self.runs, self.sums, self.products[:, asked], self.pairs[:, asked])

    def quantile(self, q: float) -> Floats:
        """Smallest counts (T, S) with at least a share q of the runs at or below them, within `quantile_error`."""
        if not 0 <= q <= 1:
            raise ValueError(f"q = {q}; expected a probability")
        rank = max(1, int(np.ceil(q * self.runs)))
        n_used = int(((self.high >> self.shift) - self.origin).max()) + 1
        bins = self.origin + (self.histogram[:, :, :n_used].cumsum(axis=2) < rank).sum(axis=2)
        middle = (bins << self.shift) + ((1 << self.shift) - 1) // 2
        return np.asarray(np.clip(middle, self.low, self.high), dtype=np.float64)

    def quantile_error(self) -> Ints:
        """Largest error of a quantile, counts (T, S): 0 if bins are one count wide, else half their width."""
        return (1 << self.shift) // 2

    def marginal(self, species: str) -> Floats:
        """Shares (T, M + 1) of the runs with 0, 1, ..., M copies of one species."""
        s = self.network.index(species)
        if self.shift[:, s].any():
            raise ValueError(
                f"counts of {species!r} spread from {self.low[:, s].min()} to {self.high[:, s].max()}; they were "
                f"collected in bins of up to {2 ** int(self.shift[:, s].max())}: ask for `marginal_at` a time"
            )
        table = np.zeros((self.times.size, int(self.high[:, s].max()) + 1))
        for row, first, tally in zip(table, self.origin[:, s], self.histogram[:, s], strict=True):
            seen = np.flatnonzero(tally)
            row[first + seen] = tally[seen] / self.runs
        return table

    def marginal_at(self, species: str, time: float, level: float = 0.95) -> Marginal:
        """The distribution of one species at one of the times, with intervals of its probabilities."""
        s, here = self.network.index(species), np.flatnonzero(self.times == time)
        if not here.size:
            raise ValueError(f"time = {time:g}; expected one of the {self.times.size} times of the runs")
        t = int(here[0])
        width = 1 << int(self.shift[t, s])
        last = int(self.high[t, s] >> self.shift[t, s]) - int(self.origin[t, s])
        found = self.histogram[t, s, : last + 1]
        first = (self.origin[t, s] + np.arange(last + 1)) * width
        low, high = binomial_limits(found, self.runs, level)
        unit = self.network.time_unit
        return Marginal(species, float(time), first, width, found / self.runs, low, high, level, unit, s)

    def merged(self, other: EnsembleStatistics) -> EnsembleStatistics:
        """Statistics of the runs of both, which must be different runs of one network at the same times."""
        if self.network.fingerprint != other.network.fingerprint:
            raise ValueError("these are statistics of different networks; merge those of one")
        if not np.array_equal(self.times, other.times):
            raise ValueError("these are statistics at different times; merge those of one grid")
        if self.pairs.shape != other.pairs.shape:
            raise ValueError("only one of these has covariances; request them in both or in neither")
        tally = Tally(self.network, self.times, self.pairs)
        tally.add_statistics(self)
        tally.add_statistics(other)
        merged = tally.statistics(self.asked + other.asked, self.method if self.method == other.method else "")
        return replace(merged, truncated=self.truncated or other.truncated)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per time and species."""
        figures = {"mean": self.mean(), "sd": self.sd(), "smallest": self.low, "largest": self.high}
        figures |= {f"q{q:g}": self.quantile(q) for q in QUANTILES}
        figures["quantile_error"] = self.quantile_error()
        return dataframe_over_times(self.times, "species", self.network.species, figures)

    def to_xarray(self) -> xr.Dataset:
        """The statistics, with dimensions time and species, and of the quantiles q."""
        figures: dict[str, Any] = {"mean": self.mean(), "sd": self.sd(), "standard_error": self.standard_error()}
        figures |= {"smallest": self.low, "largest": self.high, "quantile_error": self.quantile_error()}
        variables: dict[str, Any] = {name: (("time", "species"), values) for name, values in figures.items()}
        variables["quantile"] = (("q", "time", "species"), np.stack([self.quantile(q) for q in QUANTILES]))
        places = {"time": self.times, "species": list(self.network.species), "q": list(QUANTILES)}
        return dataset(variables, places, self.network.time_unit, runs=self.runs, method=self.method)

    def precision(self, standard_error: Floats) -> str:
        """How well the means are known, in a few words; standard_error (T, S) of the means."""
        return precision_of(standard_error)

    def columns(self, standard_error: Floats) -> dict[str, Floats]:
        """Mean, sd and standard error (T, S) for a table of a prediction."""
        return {"mean": self.mean(), "sd": self.sd(), "standard_error": standard_error}

    def bands(self) -> plots.Bands:
        """Means and the middle 95 % of the runs."""
        return plots.Bands(self.times, self.mean(), self.quantile(0.025), self.quantile(0.975))

    def approximate(self) -> None:
        """None: the runs are exact."""

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Plot the means, with bands of the middle 95 % of the runs; returns `ax`."""
        return plots.bands(ax, *self.bands(), self.network.species, self.network.time_unit)


class Tally:
    """Statistics to which runs are added."""

    def __init__(self, network: Network, times: ArrayLike, pairs: NDArray[np.intp]) -> None:
        self.network, self.times, self.pairs, self.runs = network, rising_times(times), pairs, 0
        shape = self.times.size, len(network.species)
        n_bins = bins_for(*shape)
        needed = 8.0 * shape[0] * (shape[1] * (n_bins + 6) + 6 * pairs.shape[1])
        check_memory(f"statistics of {shape[1]} species at {shape[0]} times", needed, "ask for fewer times")
        self.low, self.high = np.full(shape, np.iinfo(np.int64).max), np.zeros(shape, dtype=np.int64)
        self.shift, self.origin = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
        self.histogram = np.zeros((*shape, n_bins), dtype=np.int64)
        self.sums: Exact = np.zeros(shape, dtype=object)
        self.products: Exact = np.zeros((shape[0], pairs.shape[1]), dtype=object)

    def add(self, counts: Ints) -> None:
        """Add the counts (runs, T, S) of more runs; where these have fewer times, the others are dropped."""
        if not len(counts):
            return
        self.cut(counts.shape[1])
        counts = np.ascontiguousarray(counts)
        twins.extend_range(counts, self.low, self.high)
        self._widen()
        twins.tally(counts, self.shift, self.origin, self.histogram)
        reference, runs = counts[0], len(counts)
        sums, products = self._deviations(counts, reference)
        # Back from deviations to the counts themselves, so that what is kept does not depend on the reference.
        (first, second), base = self.pairs, reference.astype(object)
        a, b = base[:, first], base[:, second]
        self.products += products + a * sums[:, second] + b * sums[:, first] + runs * a * b
        self.sums += sums + runs * base
        self.runs += runs

    def cut(self, n_times: int) -> None:
        """Keep the first times alone."""
        if n_times < self.times.size:
            for name in ("times", "low", "high", "shift", "origin", "histogram", "sums", "products"):
                setattr(self, name, np.ascontiguousarray(getattr(self, name)[:n_times]))

    def _deviations(self, counts: Ints, reference: Ints) -> tuple[Exact, Exact]:
        """Exact sums of the deviations (T, S) and of their products (T, P)."""
        furthest = max(int((self.high - reference).max()), int((reference - self.low).max()), 1)
        at_a_time = LARGEST_SQUARE // furthest**2
        first, second = self.pairs
        if at_a_time == 0:  # one square alone passes 2**63
            off = counts.astype(object) - reference
            return off.sum(axis=0), (off[:, :, first] * off[:, :, second]).sum(axis=0)
        sums, products = np.zeros_like(self.sums), np.zeros_like(self.products)
        for begin in range(0, len(counts), at_a_time):
            part = counts[begin : begin + at_a_time]
            part_sums, part_products = np.zeros(sums.shape, np.int64), np.zeros(products.shape, np.int64)
            twins.add_products(part, reference, first, second, part_sums, part_products)
            sums += part_sums
            products += part_products
        return sums, products

    def _widen(self) -> None:
        """Make the histograms hold low to high."""
        shift, origin = np.empty_like(self.shift), np.empty_like(self.origin)
        twins.fit_bins(self.low, self.high, self.histogram.shape[2], shift, origin)
        if self.runs:
            twins.rebin(self.histogram, self.shift, self.origin, shift, origin)
        self.shift, self.origin = shift, origin

    def variance(self) -> Floats:
        """Variance (T, S) among the runs, with runs - 1, rounded once."""
        own = self.pairs[0] == self.pairs[1]
        return covariances_of(self.runs, self.sums, self.products[:, own], self.pairs[:, own])

    def central_moments(self, highest: int) -> Floats:
        """Moments (highest + 1, T, S) about the mean, from the histograms; those of bins wider than a count are about
        the mean of their middles."""
        moments = np.zeros((highest + 1, *self.low.shape))
        moments[0] = 1.0
        for s, middle, share in self._bins():
            away = middle - (share * middle).sum(axis=1, keepdims=True)
            term = share * away
            for power in range(2, highest + 1):
                term = term * away
                moments[power, :, s] = term.sum(axis=1)
        return moments

    def moments_outside(self, low: Ints, high: Ints, mean: Floats, highest: int) -> Floats:
        """What counts below `low` and above `high` (T, S) add to the moments (highest + 1, T, S) about `mean` (T, S),
        from the histograms."""
        moments = np.zeros((highest + 1, *mean.shape))
        for s, middle, share in self._bins():
            term = np.where((middle < low[:, s, None]) | (middle > high[:, s, None]), share, 0.0)
            for power in range(highest + 1):
                moments[power, :, s] = term.sum(axis=1)
                term = term * (middle - mean[:, s, None])
        return moments

    def _bins(self) -> Iterator[tuple[int, Floats, Floats]]:
        """Of each species the middles of its bins (T, B), and the share of the runs in each."""
        used = int(((self.high >> self.shift) - self.origin).max()) + 1
        for s in range(self.low.shape[1]):
            width = 1 << self.shift[:, s, None]
            middle = (self.origin[:, s, None] + np.arange(used)) * width + (width - 1) / 2
            yield s, middle, self.histogram[:, s, :used] / self.runs

    def add_statistics(self, other: EnsembleStatistics) -> None:
        """Add runs whose statistics are known."""
        self.low, self.high = np.minimum(self.low, other.low), np.maximum(self.high, other.high)
        self._widen()
        kernels.statistics.pour(other.histogram, other.shift, other.origin, self.histogram, self.shift, self.origin)
        self.sums += other.sums
        self.products += other.products
        self.runs += other.runs

    def statistics(self, asked: int, method: str = "") -> EnsembleStatistics:
        """Statistics of the runs added so far, by the method of that name; nothing can be added afterwards."""
        if not self.runs:
            raise ValueError("no runs were added, so there are no statistics; add some first")
        arrays = self.low, self.high, self.shift, self.origin, self.histogram, self.sums, self.products, self.pairs
        for array in arrays:
            read_only(array)
        return EnsembleStatistics(self.network, self.times, self.runs, asked, *arrays, method)


def bins_for(n_times: int, n_species: int) -> int:
    """Bins of each histogram: as many as the memory for all of them allows."""
    n_bins = MOST_BINS
    while n_bins > FEWEST_BINS and 8 * n_bins * n_times * n_species > HISTOGRAM_BYTES:
        n_bins //= 2
    return n_bins


def covariances_of(runs: int, sums: Exact, products: Exact, pairs: NDArray[np.intp]) -> Floats:
    """Covariances (T, K) of pairs (2, K) of species among the runs, with runs - 1, rounded once."""
    first, second = pairs
    whole = runs * products - sums[:, first] * sums[:, second]
    return np.asarray(whole / (runs * (runs - 1)), dtype=np.float64)


def kept_pairs(n_species: int, covariances: bool | None = None) -> NDArray[np.intp]:
    """Pairs (2, P) of species whose products are kept: all, or each species with itself only."""
    if n_species <= MOST_COVARIED if covariances is None else covariances:
        return np.array(np.triu_indices(n_species))
    return np.tile(np.arange(n_species), (2, 1))
