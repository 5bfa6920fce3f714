"""When runs are enough: looks at the runs made so far, each of which spends some of the chance to be wrong.

At a look with n runs, figure i (a mean, or a variance) has come out with an error of Z_i sqrt((v_i + r_i d_i) / n) or
so. v_i is the variance of what is averaged and d_i the tolerance; r_i d_i, the term of Bernstein's inequality, stands
for the skewness, r_i being the third central moment over the second, and at least one copy. The Z_i are standard normal
with the correlations that the first runs show, so that neighbouring times and species that move together count once
(multiplier bootstrap: Chernozhukov, Chetverikov & Kato 2013, doi:10.1214/13-AOS1161), over a common root of chi square,
as Student has it. The runs are enough where the largest |error| / tolerance stays below 1 with the probability left.

A look that fails by chance must not become an answer because there were many looks: over all looks the chances to be
wrong add up to 1 - `LEVEL` (union bound). Looks that only plan the next one get a tenth of it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kinetics.predicting.accuracy import LEVEL, AskedAccuracy
from kinetics.runs.statistics import Tally
from kinetics.support.arrays import Floats, Ints

FIRST_RUNS = 16
GROWTH = 8  # of the runs, from a look that plans to the next
MARGIN = 1.05  # of the runs planned for the last look, because their variance is an estimate
ROWS, ROW_BYTES = 64, 2**25  # runs that are kept for their correlations
DRAWN = 1000  # of the largest error
ONE_THREAD = 2**18  # multiplications; for more at a time BLAS wakes threads, which cost more than they bring
SMALL = 0.5  # of the largest ratio of error and tolerance; figures below matter to no quantile of the largest
PLANNING, LASTING, AGAIN = 0.1, 0.75, 0.15  # shares of the chance to be wrong


def planning_shares() -> Iterator[float]:
    """Of the chance to be wrong, what each look that plans may spend."""
    share = (1 - LEVEL) * PLANNING
    while True:
        share /= 2
        yield share


def lasting_shares() -> Iterator[float]:
    """What each look may spend that was planned to be the last."""
    yield (1 - LEVEL) * LASTING
    share = (1 - LEVEL) * AGAIN
    while True:
        share /= 2
        yield share


class Look:
    """What the runs so far say of their own errors.

    asked : of "mean" or "sd"
    rows : (m, T, S) counts of some of the runs
    is_known : (T, S) figures that are no matter of chance
    """

    def __init__(self, asked: AskedAccuracy, tally: Tally, rows: Ints, is_known: NDArray[np.bool_], seed: int) -> None:
        self.runs = tally.runs
        mean = (tally.sums / tally.runs).astype(float)
        moments = central_moments(tally, mean, 3 if asked.of == "mean" else 6)
        variance = moments[2] * tally.runs / (tally.runs - 1)
        if asked.of == "mean":
            values, spread, third = rows.astype(float), variance, moments[3]
            tolerances = np.broadcast_to(asked.tolerances(mean), mean.shape)
        else:
            values = (rows - mean) ** 2
            spread = np.maximum(moments[4] - moments[2] ** 2, 0.0)
            third = moments[6] - 3 * moments[4] * moments[2] + 2 * moments[2] ** 3
            tolerances = of_variance(np.sqrt(variance), asked.tolerances(np.sqrt(variance)))
        skew = np.divide(np.abs(third), spread, out=np.zeros_like(spread), where=spread > 0.0)
        errors = np.sqrt((spread + np.maximum(skew, 1.0) * tolerances) / self.runs)
        ratios = np.where(is_known, 0.0, errors / tolerances)
        self._largest = largest_errors(values, ratios, self.runs - 1, seed)

    def share_of_tolerance(self, chance: float) -> float:
        """The share of their tolerances that all errors keep within, but for this chance."""
        return float(np.quantile(self._largest, 1 - chance, method="higher"))

    def runs_needed(self, chance: float) -> float:
        """Runs after which that share will be 1."""
        return self.runs * self.share_of_tolerance(chance) ** 2


def of_variance(sd: Floats, tolerances: Floats) -> Floats:
    """Largest error (T, S) of variances whose roots (T, S) may be off by `tolerances` (S,)."""
    down = np.where(sd > tolerances, -1.0, 1.0)  # below 0 there is no variance that could be missed
    return (2.0 * sd + down * tolerances) * tolerances


def central_moments(tally: Tally, mean: Floats, highest: int) -> Floats:
    """Moments (highest + 1, T, S) about the mean, from the histograms."""
    moments = np.zeros((highest + 1, *mean.shape))
    used = int(((tally.high >> tally.shift) - tally.origin).max()) + 1
    for s in range(mean.shape[1]):
        width = 1 << tally.shift[:, s, None]
        away = (tally.origin[:, s, None] + np.arange(used)) * width + (width - 1) / 2 - mean[:, s, None]
        term = tally.histogram[:, s, :used] / tally.runs
        for power in range(highest + 1):
            moments[power, :, s] = term.sum(axis=1)
            term = term * away
    return moments


def largest_errors(values: Floats, ratios: Floats, freedom: int, seed: int) -> Floats:
    """Draws (B,) of the largest |error| / tolerance, where single errors have these ratios (T, S) to tolerances.

    values : (m, T, S) what is averaged, of some runs, for the correlations. Figures in which these runs do not differ
        have none; of each species they count as one, independent of all others.
    """
    # the same draws at every look, so that a look finds what the one before foretold
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    drawn = rng.standard_normal((DRAWN, len(values)), dtype=np.float32)
    common = np.sqrt(rng.chisquare(freedom, DRAWN) / freedom)
    away = values - values.mean(axis=0)
    scale = np.sqrt((away**2).sum(axis=0))
    matters = ratios > SMALL * ratios.max()
    moves = matters & (scale > 0.0)
    single = np.where(matters & ~moves, ratios, 0.0).max(axis=0)
    single = single[single > 0.0]
    errors = np.abs(rng.standard_normal((DRAWN, single.size + 1)) * np.append(single, 0.0)).max(axis=1)
    if moves.any():
        weights = (away[:, moves] * (ratios[moves] / scale[moves])).astype(
            np.float32
        )  # digits enough, at half the cost
        at_a_time = max(1, ONE_THREAD // weights.size)
        for begin in range(0, DRAWN, at_a_time):
            part = slice(begin, begin + at_a_time)
            errors[part] = np.maximum(errors[part], np.abs(drawn[part] @ weights).max(axis=1))
    return errors / common
