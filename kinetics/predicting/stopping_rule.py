"""The stopping rule: interim looks at the runs made so far say whether they are enough.

At a look with n runs, figure i (a mean, or a variance) has come out with an error of Z_i sqrt((v_i + r_i d_i) / n) or
so. v_i is the variance of what is averaged and d_i the tolerance; r_i d_i, the term of Bernstein's inequality, stands
for the skewness, r_i being the third central moment over the second, and at least one copy. The Z_i are standard normal
with the correlations that the first runs show, so that neighbouring times and species that move together count once
(multiplier bootstrap: Chernozhukov, Chetverikov & Kato 2013, doi:10.1214/13-AOS1161), over a common root of chi square,
as Student has it. The runs are enough where the largest |error| / tolerance stays below 1 but for a chance.

Every look may be the last, and their chances need not add up: whether runs are enough depends on their variances
alone, of which means of normal figures are independent (Chow & Robbins 1965, doi:10.1214/aoms/1177700156). Looks that
find variances too small by chance cost something, and Student's factor makes up for that: for normal figures the
chance to be wrong stays below 1 - `LEVEL` with the looks made here, as a test computes. If low means come with low
variances, as among small counts, the term of Bernstein's inequality makes up for it. Rare events that runs have not
shown yet enter their moments by `ForcedFirings`; if channels cannot be forced, looks at fewer than `FEW` runs are
allowed a much smaller chance.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from math import ceil
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from kinetics.predicting import tuning
from kinetics.predicting.accuracy import AskedAccuracy
from kinetics.predicting.forced_firings import ForcedFirings
from kinetics.predicting.tuning import DRAWN, LEVEL
from kinetics.sampling.statistics import Tally
from kinetics.support.arrays import Floats, Ints


class InterimLook:
    """An interim look at the runs so far: the errors of their figures, and how many runs more are needed.

    asked : of "mean" or "sd"
    rows : (m, T, S) counts of some of the runs
    is_known : (T, S) figures that are no matter of chance
    forced : rare events that runs may not have shown; None if channels cannot be forced, which counts as some left out
    """

    def __init__(
        self, asked: AskedAccuracy, tally: Tally, rows: Ints, is_known: NDArray[np.bool_], seed: int,
        forced: ForcedFirings | None = None,
    ) -> None:  # fmt: skip
        self.runs = tally.runs
        mean = (tally.sums / tally.runs).astype(float)
        highest = 3 if asked.of == "mean" else 6
        unseen = np.zeros((highest + 1, *mean.shape)) if forced is None else forced.moments(tally, mean, highest)
        moments = tally.central_moments(highest) + unseen
        variance = tally.variance() + unseen[2]  # those of the histograms leave out what is within a bin
        if asked.of == "mean":
            values, spread, third = rows.astype(float), variance, moments[3]
            tolerances = np.broadcast_to(asked.tolerances(np.maximum(mean + unseen[1], 0.0)), mean.shape)
        else:
            values = (rows - mean) ** 2
            spread = np.maximum(moments[4] - moments[2] ** 2, 0.0)
            third = moments[6] - 3 * moments[4] * moments[2] + 2 * moments[2] ** 3
            tolerances = of_variance(np.sqrt(variance), asked.tolerances(np.sqrt(variance)))
        skew = np.divide(np.abs(third), spread, out=np.zeros_like(spread), where=spread > 0.0)
        errors = np.sqrt((spread + np.maximum(skew, 1.0) * tolerances) / self.runs)
        self.ratios = np.where(is_known, 0.0, errors / tolerances)
        self._values, self._seed, self._is_forced = values, seed, forced is not None and not forced.left_out
        self.chance = chance_at(self.runs, self._is_forced)

    @cached_property
    def _largest(self) -> Floats:
        return largest_errors(self._values, self.ratios, self._seed)

    @cached_property
    def rough_runs(self) -> tuple[float, float]:
        """Between how many runs the needed ones are, whatever the correlations: of one figure, and of independent
        ones."""
        largest = float(self.ratios.max(initial=0.0))
        many = max(int((self.ratios > tuning.SMALL * largest).sum()), 1)
        one, all_of_them = (NormalDist().inv_cdf(1 - self.chance / 2 / n) * largest for n in (1, many))
        return self.runs * one**2, self.runs * all_of_them**2

    @property
    def about(self) -> float:
        """Runs needed, roughly."""
        one, all_of_them = self.rough_runs
        return float(np.sqrt(one * all_of_them))

    @property
    def is_far(self) -> bool:
        """Whether the next look will not be the last, by one figure alone."""
        return self.rough_runs[0] > tuning.GROWTH * self.runs

    def share_of_tolerance(self) -> float:
        """The share of their tolerances that all errors keep within, but for a small chance."""
        return quantile(self._largest / students_roots(self.runs - 1, self._seed), 1 - self.chance)

    def runs_needed(self) -> float:
        """Runs after which that share will be 1, most likely; roughly, where that is far."""
        if self.is_far:
            return self.about
        early = self.fixed(self.chance)
        if early < tuning.FEW or self.runs >= tuning.FEW:
            return early
        return max(self.fixed(chance_at(tuning.FEW, self._is_forced)), tuning.FEW)

    def fixed(self, chance: float) -> float:
        """A fixed number of runs after which that share is 1, for this chance."""
        return self.runs * quantile(self._largest, 1 - chance) ** 2


def chance_at(runs: int, is_forced: bool) -> float:
    """Allowed chance to be wrong of a look at so many runs; is_forced : whether all rare channels were forced."""
    return (1 - LEVEL) * (tuning.ALLOWED if is_forced or runs >= tuning.FEW else tuning.CAREFUL)


def quantile(drawn: Floats, level: float) -> float:
    """The smallest draw with at least this share of them at or below it."""
    rank = min(ceil(level * drawn.size), drawn.size) - 1
    return float(np.partition(drawn, rank)[rank])


def of_variance(sd: Floats, tolerances: Floats) -> Floats:
    """Largest error (T, S) of variances whose roots (T, S) may be off by `tolerances` (S,)."""
    down = np.where(sd > tolerances, -1.0, 1.0)  # below 0 there is no variance that could be missed
    return (2.0 * sd + down * tolerances) * tolerances


@lru_cache(maxsize=2)
def normals(rows: int, seed: int) -> NDArray[np.float32]:
    """Standard normal draws (rows, B), equal at every look, so that a look finds what the one before predicted."""
    return generator(seed, 0).standard_normal((rows, DRAWN), dtype=np.float32)


def students_roots(freedom: int, seed: int) -> Floats:
    """Draws (B,) of an estimate of the standard deviation over the true one."""
    return np.sqrt(generator(seed, 1).chisquare(freedom, DRAWN) / freedom)


def generator(seed: int, what: int) -> np.random.Generator:
    """Random numbers apart from those of the runs."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2, what)))


def largest_errors(values: Floats, ratios: Floats, seed: int) -> Floats:
    """Draws (B,) of the largest |error| / tolerance, where single errors have these ratios (T, S) to tolerances.

    values : (m, T, S) what is averaged, of some runs, for the correlations. Figures in which these runs do not differ
        have none; of each species they count as one, independent of all others.
    """
    rng = generator(seed, 2)
    away = values - values.mean(axis=0)
    scale = np.sqrt((away**2).sum(axis=0))
    matters = ratios > tuning.SMALL * ratios.max()
    moves = matters & (scale > 0.0)
    single = np.where(matters & ~moves, ratios, 0.0).max(axis=0)
    single = single[single > 0.0]
    errors: Floats = np.abs(rng.standard_normal((single.size + 1, DRAWN)) * np.append(single, 0.0)[:, None]).max(axis=0)
    if moves.any():
        weights = away[:, moves] * (ratios[moves] / scale[moves])
        if 3 * weights.shape[1] < len(weights):  # the root of their covariances says the same in fewer rows
            sizes, axes = np.linalg.eigh(weights.T @ weights)
            weights = (axes * np.sqrt(np.maximum(sizes, 0.0))) @ axes.T
        drawn, turned = normals(len(weights), seed), weights.T.astype(np.float32)  # digits enough, at half the cost
        at_a_time = max(1, tuning.ONE_THREAD // weights.size)
        for begin in range(0, DRAWN, at_a_time):
            part = slice(begin, begin + at_a_time)
            errors[part] = np.maximum(errors[part], np.abs(turned @ drawn[:, part]).max(axis=0))
    return errors
