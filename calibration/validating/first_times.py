"""First-passage times to a species: those of mechanics runs beside the predicted distribution."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from calibration import plots
from kinetics.markov.transient.search import MAX_STATES, TooManyStatesError
from kinetics.network import Model, Network
from kinetics.network.laws.writing import quoted
from kinetics.runs import JumpPath, TruncatedRunsError
from kinetics.sampling import Direct, first_times_of_draws
from kinetics.support.arrays import Floats, Ints
from kinetics.support.intervals import student_interval
from kinetics.support.plots import colour
from kinetics.support.shown import ResultTable, Shown, facts, on_axes
from kinetics.support.tables import figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DRAWS = 9999  # of the null distribution of the test; the smallest p-value is 1 / (DRAWS + 1)
CURVE = 401  # points of the predicted curve, from 0 to the horizon
SAMPLES = 10_000  # SSA runs that stand in for the exact distribution; the error of their curve is 0.005 at most


@dataclass(frozen=True, eq=False, repr=False)
class FirstTimeComparison(Shown):
    """First-passage times observed in runs beside the predicted distribution; all times in tu.

    observed : (n,) first times, nan if there was none by the horizon (censored)
    horizon : time until which every run was observed; later first times count as censored
    observed_mean, low, high : mean of min(time, horizon) with its Student t interval over the runs
    predicted_mean : predicted mean of min(time, horizon)
    predicted_error : its standard error by sampling; 0 if the distribution is solved for
    mean, sd : of the predicted distribution without a horizon; nan if it is sampled
    curve_times, curve : predicted distribution function
    samples : number of SSA runs that replace the solution; 0 if the distribution is solved for
    distance, p_value : Kolmogorov-Smirnov distance up to the horizon, and the probability of one at least as large

    >>> from calibration import compare_first_times
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("A -> B, 0.1")
    >>> paths = [JumpPath(decay, {"A": 1}, [2.0], [0], end=5.0), JumpPath(decay, {"A": 1}, [], [], end=5.0)]
    >>> found = compare_first_times(decay, paths, "B")
    >>> found.observed.tolist(), found.censored, found.observed_mean, found.mean
    ([2.0, nan], 1, 3.5, 10.0)
    """

    species: str
    observed: Floats
    horizon: float
    observed_mean: float
    low: float
    high: float
    predicted_mean: float
    predicted_error: float
    mean: float
    sd: float
    curve_times: Floats
    curve: Floats
    samples: int
    distance: float
    p_value: float

    @property
    def headline(self) -> str:
        """One line: the species, and the number of runs."""
        return f"first {self.species} in {len(self.observed)} runs until {self.horizon:g} tu; p {self.p_value:.2g}"

    def summary(self) -> ResultTable:
        """Observed beside predicted."""
        values = {
            "observed mean, cut at the horizon": f"{self.observed_mean:.4g} [{figure(self.low)}, {figure(self.high)}]",
            "predicted mean, cut alike": f"{self.predicted_mean:.4g}",
            "its error by sampling": f"{self.predicted_error:.2g}" if self.samples else "none: solved",
            "runs without one": str(self.censored),
            "Kolmogorov-Smirnov distance": f"{self.distance:.3g}",
            "p": f"{self.p_value:.2g}",
        }
        return facts(self.headline, values)

    @property
    def is_exact(self) -> bool:
        """True if the predicted distribution is free of sampling error."""
        return self.samples == 0

    @property
    def curve_error(self) -> float:
        """Largest standard error of the curve by sampling; 0 if it is exact."""
        return 0.0 if self.is_exact else float(np.sqrt(self.curve * (1 - self.curve) / self.samples).max())

    @property
    def censored(self) -> int:
        """Number of runs without a copy by the horizon."""
        return int(np.isnan(self.observed).sum())

    @on_axes
    def plot(self, ax: Axes, place: int = 0) -> Axes:
        """Plot the share of runs with a copy, with its 95 % limits, and the predicted curve; returns `ax`.

        place : the species' in its network, which gives the curve its colour
        """
        # with a rate of 0 the chain may end elsewhere, and the mean is infinite
        mean = f", mean {self.mean:.4g} tu" if np.isfinite(self.mean) else ""
        label = f"exact{mean}" if self.is_exact else f"SSA, within {self.curve_error:.1g} (1 s.e.)"
        predicted = (label, self.curve_times, self.curve)
        return plots.first_times(
            ax, self.species, self.observed, self.horizon, predicted, self.predicted_mean, colour(place)
        )


def compare_first_times(
    network: Network,
    paths: Sequence[JumpPath],
    species: str,
    level: float = 0.95,
    seed: int = 0,
    rate_draws: Floats | None = None,
    first_run: int = 0,
    max_states: int = MAX_STATES,
    horizon: float | None = None,
) -> FirstTimeComparison:
    """Compare first times of `paths` with the first-passage distribution of `network` from the same initial state.

    network : a network with rate constants
    rate_draws : (groups, R) rate constants, for whose uncertainty the test allows; None: the rates are taken as known
    first_run : number of the first simulated run, see `Direct.simulate`
    max_states : with more states before the target than this, the distribution is that of 10,000 SSA runs
    horizon : time, tu, until which all runs would have been observed had they not ended with their first copy; None:
        runs did not end so, and the horizon is the end of the shortest
    ValueError: the species is there at the start, or a run without a copy ends before the horizon

    Runs without a copy by the horizon are kept: they enter both means as `horizon`, and the test compares the curves
    only up to there, with the null distribution drawn under the same censoring.

    >>> from calibration import compare_first_times
    >>> from kinetics import Network, sample_path
    >>> decay = Network.from_text("A -> B, 0.1")
    >>> paths = [sample_path(decay, {"A": 1}, end=30.0, seed=1, run=run) for run in range(50)]
    >>> found = compare_first_times(decay, paths, "B")
    >>> round(found.predicted_mean, 3), found.low < found.predicted_mean < found.high, found.p_value > 0.01
    (9.502, True, True)
    """
    if paths[0].initial[network.index(species)]:
        raise ValueError(f"the initial state already holds a {species}: no first one to wait for; name another target")
    times = np.array([path.first_time(species) for path in paths])
    ends = np.array([path.end for path in paths])
    if horizon is None:
        horizon = float(ends.min())
    elif (short := np.isnan(times) & (ends < horizon)).any():
        raise ValueError(f"horizon = {horizon:g}, but a run without a copy ends at {ends[short].min():g} tu")
    times[times > horizon] = np.nan
    cut = np.nan_to_num(times, nan=horizon)
    grid = np.linspace(0.0, horizon, CURVE)
    passage = _passage(network, paths[0].initial, species, grid, seed, first_run, max_states)
    curve = passage.curve
    levels = np.where(np.isfinite(times), passage.cdf(cut), np.inf)
    null = None
    if rate_draws is not None:
        cells = np.unique(np.append(np.interp(np.linspace(0.0, curve[-1], CURVE), curve, grid), horizon))
        bounds = np.append(passage.cdf(cells), np.inf)
        null = _drawn_levels(network, paths, species, rate_draws, (cells, bounds), seed, first_run + passage.samples)
    distance, p_value = censored_ks_test(levels, curve[-1], null, seed)
    low, high = student_interval(cut, level)
    return FirstTimeComparison(
        species=species,
        observed=times,
        horizon=horizon,
        observed_mean=float(cut.mean()),
        low=max(float(low), 0.0),  # no wait is negative or beyond the horizon, whatever the t interval of few runs says
        high=min(float(high), horizon),
        predicted_mean=float(np.trapezoid(1 - curve, grid)),
        predicted_error=passage.mean_error,
        mean=passage.mean,
        sd=passage.sd,
        curve_times=grid,
        curve=curve,
        samples=passage.samples,
        distance=distance,
        p_value=p_value,
    )


@dataclass(frozen=True, eq=False)
class _Passage:
    """Distribution of a first passage: its distribution function, and the same on a grid up to the horizon.

    mean, sd : without a horizon; nan if unknown
    mean_error : standard error of the mean of min(time, horizon); samples : runs behind it, 0 if it is exact
    """

    cdf: Callable[[Floats], Floats]
    curve: Floats
    mean: float
    sd: float
    mean_error: float = 0.0
    samples: int = 0


def _passage(
    network: Network, initial: Ints, species: str, grid: Floats, seed: int, first_run: int, max_states: int
) -> _Passage:
    """The exact distribution, or that of SSA runs where the states are too many."""
    from kinetics.markov import first_passage
    from kinetics.markov.passage.elimination import TooLargeError

    try:
        exact = first_passage(network, initial, species, max_states=max_states)
        return _Passage(exact.cdf, exact.cdf(grid), exact.mean, exact.sd)
    except (TooManyStatesError, TooLargeError):
        pass
    end = float(grid[-1])
    found = Direct().first_times(network, initial, _present(species), end, SAMPLES, seed, first_run=first_run)
    if found.truncated is not None:
        raise TruncatedRunsError(found.truncated)
    curve = np.searchsorted(np.sort(found.observed[found.is_reached]), grid, side="right") / SAMPLES
    return _Passage(
        cdf=lambda times: np.interp(times, grid, curve),
        curve=curve,
        mean=float("nan"),
        sd=float("nan"),
        mean_error=float(found.observed.std(ddof=1) / np.sqrt(SAMPLES)),
        samples=SAMPLES,
    )


def _present(species: str) -> str:
    """The condition that there is a copy of a species."""
    return f"{quoted(species)} >= 1"


def _drawn_levels(
    network: Network,
    paths: Sequence[JumpPath],
    species: str,
    rate_draws: Floats,
    cells: tuple[Floats, Floats],
    seed: int,
    first_run: int,
) -> Floats:
    """Levels (groups, n) of simulated first times under each draw of the rates, on the point rates' distribution.

    cells : times (C,) at which the runs are looked at, and that distribution's levels (C + 1,) there, the last one inf

    A run's level is drawn evenly from the cell in which its first copy came: exact where the draw is the point rates.
    """
    times, bounds = cells
    n = len(paths)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    levels = np.empty((len(rate_draws), n))
    made = first_times_of_draws(
        Model.of(network, paths[0].initial),
        rate_draws,
        _present(species),
        times[-1],
        n,
        seed,
        method=Direct(),
        first_run=first_run,
    )
    for g, first in enumerate(made):
        cell = np.searchsorted(times, first)
        lower = bounds[np.maximum(cell - 1, 0)]
        upper = bounds[cell]
        levels[g] = np.where(np.isfinite(upper), lower + rng.random(n) * (upper - np.minimum(lower, upper)), np.inf)
    return levels


def censored_ks_test(
    levels: Floats, limit: float, null_levels: Floats | None = None, seed: int = 0
) -> tuple[float, float]:
    """Kolmogorov-Smirnov test of n times of known distribution, seen only while its distribution function is <= limit.

    levels : (n,) distribution function at the times, inf for those not seen: uniform before the censoring
    null_levels : (groups, n) levels of simulated times; None: uniforms, which is the distribution itself

    Returns the distance and its p-value among samples censored in the same way.
    """
    n = levels.size
    distance = _distances(levels[None, :], limit)[0]
    if null_levels is None:
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
        chunk = max(1, 10**6 // n)  # rows at a time, so that many runs do not fill the memory
        sizes = [min(chunk, DRAWS - begin) for begin in range(0, DRAWS, chunk)]
        null = np.concatenate([_distances(rng.random((size, n)), limit) for size in sizes])
    else:
        null = _distances(null_levels, limit)
    return float(distance), float((1 + np.count_nonzero(null >= distance - 1e-12)) / (null.size + 1))


def _distances(levels: Floats, limit: float) -> Floats:
    """Largest distance (draws,) on [0, limit] between the empirical curves of `levels` (draws, n) and the diagonal."""
    n = levels.shape[1]
    x = np.sort(levels, axis=1)
    step = np.arange(n + 1) / n
    # at each level seen the curve steps up; beyond the last one the diagonal goes on to the limit
    above = np.where(x <= limit, step[1:] - x, 0.0).max(axis=1)
    below = (np.minimum(x, limit) - step[:-1]).max(axis=1)
    return np.asarray(np.maximum(above, below))
