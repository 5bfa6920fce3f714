"""Time to the first copy of a species: observed in runs, and by the exact law of first passage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinetics.arrays import Floats, Ints
from kinetics.methods import Direct
from kinetics.network import Network
from kinetics.paths import JumpPath

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DRAWS = 9999  # of the null distribution of the test; the smallest p-value is 1 / (DRAWS + 1)
CURVE = 401  # points of the exact curve, from 0 to the horizon


@dataclass(frozen=True, eq=False)
class FirstTimes:
    """First times seen in runs beside those predicted; all times in tu.

    observed : (n,) first times, nan where none was seen by the horizon (censored)
    horizon : every run was watched at least so long; later first times count as censored
    observed_mean, low, high : mean of min(time, horizon) with its Student t interval over the runs
    predicted_mean : exact mean of min(time, horizon), to stand beside it
    mean, sd : exact, without a horizon
    curve_times, curve : exact distribution function
    distance, p_value : Kolmogorov-Smirnov distance up to the horizon, and the chance of one as large
    """

    species: str
    observed: Floats
    horizon: float
    observed_mean: float
    low: float
    high: float
    predicted_mean: float
    mean: float
    sd: float
    curve_times: Floats
    curve: Floats
    distance: float
    p_value: float

    @property
    def censored(self) -> int:
        """Runs without a copy by the horizon."""
        return int(np.isnan(self.observed).sum())

    def plot(self, ax: Axes) -> Axes:
        """Share of runs with a copy, with its 95 % band, beside the exact curve; returns `ax`."""
        from calibration import plots

        return plots.first_times(ax, self)


def compare_first_times(
    network: Network,
    paths: Sequence[JumpPath],
    species: str,
    level: float = 0.95,
    seed: int = 0,
    rate_draws: Floats | None = None,
    first_run: int = 0,
) -> FirstTimes:
    """First times of `paths` against the exact law of `network` (with rate constants) from the same initial state.

    rate_draws : (groups, R) rate constants; the test then allows for their uncertainty. None: the rates are exact.
    first_run : number of the first simulated run, see `Direct.simulate`

    Runs still waiting at the horizon are not thrown away: they enter both means as `horizon`, and the test compares the
    curves only up to there, with the null distribution drawn under the same censoring.
    """
    from kinetics.methods.passage import first_passage

    if paths[0].initial[network.index(species)]:
        raise ValueError(f"the initial state already holds a {species}: no first one to wait for; name another target")
    horizon = float(min(path.end for path in paths))
    times = np.array([path.first_time(species) for path in paths])
    times[times > horizon] = np.nan
    cut = np.nan_to_num(times, nan=horizon)
    law = first_passage(network, paths[0].initial, species)
    grid = np.linspace(0.0, horizon, CURVE)
    curve = law.cdf(grid)
    levels = np.where(np.isfinite(times), law.cdf(cut), np.inf)
    null = None
    if rate_draws is not None:
        cells = np.unique(np.append(np.interp(np.linspace(0.0, curve[-1], CURVE), curve, grid), horizon))
        bounds = np.append(law.cdf(cells), np.inf)
        null = _drawn_levels(network, paths, species, rate_draws, (cells, bounds), seed, first_run)
    distance, p_value = censored_ks_test(levels, curve[-1], null, seed)
    low, high = student_interval(cut, level)
    return FirstTimes(
        species=species,
        observed=times,
        horizon=horizon,
        observed_mean=float(cut.mean()),
        low=max(float(low), 0.0),  # a wait is not negative, whatever the t interval of few runs says
        high=float(high),
        predicted_mean=float(np.trapezoid(1 - curve, grid)),
        mean=law.mean,
        sd=law.sd,
        curve_times=grid,
        curve=curve,
        distance=distance,
        p_value=p_value,
    )


def _drawn_levels(
    network: Network,
    paths: Sequence[JumpPath],
    species: str,
    rate_draws: Floats,
    cells: tuple[Floats, Floats],
    seed: int,
    first_run: int,
) -> Floats:
    """Levels (groups, n) of simulated first times under each draw of the rates, on the point rates' law.

    cells : times (C,) at which the runs are looked at, and the law's levels (C + 1,) there, the last one inf

    A run's level is drawn evenly from the cell in which its first copy came: exact where the draw is the point rates.
    """
    times, bounds = cells
    index, n = network.index(species), len(paths)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    # With nothing that uses up the species, it is there at a time if and only if it has come by then.
    stays = network.reactants[:, index] == 0
    levels = np.empty((len(rate_draws), n))
    for g, drawn in enumerate(rate_draws):
        runs = Direct().simulate(
            network.with_rates(drawn * stays),
            paths[0].initial,
            times,
            runs=n,
            seed=seed,
            threads=1,
            first_run=first_run + g * n,
        )
        cell = (runs.counts[:, :, index] < 1).sum(axis=1)
        lower = bounds[np.maximum(cell - 1, 0)]
        upper = bounds[cell]
        levels[g] = np.where(np.isfinite(upper), lower + rng.random(n) * (upper - np.minimum(lower, upper)), np.inf)
    return levels


def censored_ks_test(
    levels: Floats, limit: float, null_levels: Floats | None = None, seed: int = 0
) -> tuple[float, float]:
    """Kolmogorov-Smirnov test of n times whose law is known, seen only while its distribution function is <= limit.

    levels : (n,) distribution function at the times, inf for those not seen: uniform before the censoring
    null_levels : (groups, n) levels of simulated times; None: uniforms, which is the law itself

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
    return np.maximum(above, below)


def student_interval(values: Floats | Ints, level: float = 0.95) -> tuple[Floats, Floats]:
    """Interval of the mean over the first axis by Student's t; nan for a single run."""
    from scipy.special import stdtrit

    runs = len(values)
    if runs == 1:
        unknown = np.full(np.shape(values)[1:], np.nan)
        return unknown, unknown
    mean = np.mean(values, axis=0)
    half = stdtrit(runs - 1, (1 + level) / 2) * np.std(values, axis=0, ddof=1) / np.sqrt(runs)
    return mean - half, mean + half
