"""Time to the first copy of a species: observed in runs, and by the exact law of first passage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinetics.arrays import Floats, Ints
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
    distance, p_value : Kolmogorov-Smirnov distance up to the horizon at the point rates, and its chance under them
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
    network: Network, paths: Sequence[JumpPath], species: str, level: float = 0.95, seed: int = 0
) -> FirstTimes:
    """First times of `paths` against the exact law of `network` (with rate constants) from the same initial state.

    Runs still waiting at the horizon are not thrown away: they enter both means as `horizon`, and the test compares the
    curves only up to there, with the null distribution drawn under the same censoring.
    """
    from kinetics.methods.passage import first_passage

    horizon = min(path.end for path in paths)
    times = np.array([path.first_time(species) for path in paths])
    times[times > horizon] = np.nan
    law = first_passage(network, paths[0].initial, species)
    grid = np.linspace(0.0, horizon, CURVE)
    curve = law.cdf(grid)
    distance, p_value = censored_ks_test(law.cdf(times[np.isfinite(times)]), times.size, curve[-1], seed)
    low, high = student_interval(np.nan_to_num(times, nan=horizon), level)
    return FirstTimes(
        species=species,
        observed=times,
        horizon=float(horizon),
        observed_mean=float(np.nan_to_num(times, nan=horizon).mean()),
        low=float(low),
        high=float(high),
        predicted_mean=float(np.trapezoid(1 - curve, grid)),
        mean=law.mean,
        sd=law.sd,
        curve_times=grid,
        curve=curve,
        distance=distance,
        p_value=p_value,
    )


def censored_ks_test(levels: Floats, n: int, limit: float, seed: int = 0) -> tuple[float, float]:
    """Kolmogorov-Smirnov test of n times whose law is known, seen only while its distribution function is <= limit.

    levels : (m,) distribution function at the m <= n times that were seen: uniform on (0, 1) before the censoring

    Returns the distance and its p-value, by drawing n uniforms censored in the same way.
    """
    rng = np.random.default_rng(seed)
    observed = np.concatenate([levels, np.full(n - levels.size, np.inf)])
    distance = _distances(observed[None, :], limit)[0]
    chunk = max(1, 10**6 // n)  # rows at a time, so that many runs do not fill the memory
    sizes = [min(chunk, DRAWS - begin) for begin in range(0, DRAWS, chunk)]
    null = np.concatenate([_distances(rng.random((size, n)), limit) for size in sizes])
    return float(distance), float((1 + np.count_nonzero(null >= distance - 1e-12)) / (DRAWS + 1))


def _distances(levels: Floats, limit: float) -> Floats:
    """Largest distance (draws,) on [0, limit] between the empirical curves of `levels` (draws, n) and the diagonal."""
    n = levels.shape[1]
    x = np.minimum(np.sort(levels, axis=1), limit)
    step = np.arange(n + 1) / n
    # at each point seen the curve steps up; beyond the last one the diagonal goes on to the limit
    above = np.where(x < limit, step[1:] - x, 0.0).max(axis=1)
    below = (x - step[:-1]).max(axis=1)
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
