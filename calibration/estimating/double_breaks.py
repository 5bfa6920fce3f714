"""Double breaks: one collision breaks both partners, which a path shows as two breaks within a step or two.

A chain of single breaks supposes that there are none. They are measured, and no break model makes them. With a share s
of breaks followed by a second one, counts of breaks vary (1 + 3 s) / (1 + s) times as much as they would if breaks came
one by one; their means do not change.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.estimating.exposure import sojourns
from calibration.estimating.rate_fit import RateFit
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats
from kinetics.support.packages import stats

LEVEL = 0.01  # of a false call for double breaks
ROUNDING = 1e-6  # of the time between two breaks


@dataclass(frozen=True)
class DoubleBreaks:
    """How many breaks were followed closely by another one, beside what chance would give.

    within : longest time between the two, tu
    breaks : all breaks
    seen : breaks that came at most `within` after the one before, in the same run and not across a restart
    expected : the same by chance, if breaks came one by one at the propensities of a fit
    pairs : how often each pair of channels, first and second, was seen
    """

    within: float
    breaks: int
    seen: int
    expected: float
    pairs: Mapping[tuple[str, str], int]

    @property
    def share(self) -> float:
        """Share of first breaks that come with a second one, freed of chance; nan without breaks."""
        firsts = self.breaks - self.seen
        return max(self.seen - self.expected, 0.0) / firsts if firsts else float("nan")

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Limits of the share: the exact ones of a binomial probability, less what chance would give.

        They hold where chance is rare, `expected` well below 1 per ten breaks (Clopper & Pearson 1934,
        doi:10.1093/biomet/26.4.404).
        """
        if not 0 < level < 1:
            raise ValueError(f"level = {level}; expected a number between 0 and 1, such as 0.95")
        firsts = self.breaks - self.seen
        if not firsts:
            return 0.0, 1.0
        found = stats.binomtest(min(self.seen, firsts), firsts).proportion_ci(level)
        chance = self.expected / firsts
        return max(found.low - chance, 0.0), max(found.high - chance, 0.0)

    @property
    def p_value(self) -> float:
        """Probability that chance gives as many (Poisson)."""
        return float(stats.poisson.sf(self.seen - 1, self.expected))

    @property
    def variance_factor(self) -> float:
        """How much more the counts of breaks vary than those of breaks that come one by one."""
        return _variance_factor(self.share)

    @property
    def is_asked_for(self) -> bool:
        """True if the data ask for a model with double breaks: chance gives as many with probability below 1 %."""
        return self.p_value < LEVEL

    @property
    def sentence(self) -> str:
        """Sentences on the double breaks seen and expected, their share, and their effect on the spread of counts."""
        if not self.breaks:
            return "no bond broke"
        low, high = self.interval()
        seen = (
            f"{self.seen} of {self.breaks} breaks came within {self.within:.3g} tu of the one before, "
            f"{self.expected:.2g} expected by chance (p = {self.p_value:.1g}): {self.share:.1%} "
            f"[{low:.1%}, {high:.1%}] of breaks come with a second one"
        )
        if not self.is_asked_for:
            return f"{seen}; the data do not call for a model with double breaks"
        limits = f"{_variance_factor(low):.2f}, {_variance_factor(high):.2f}"
        return (
            f"{seen}, and counts of breaks vary {self.variance_factor:.2f} [{limits}] times as much as in a chain "
            f"of single breaks, which has the right means and a spread that is too small by this factor"
        )

    def to_dict(self) -> dict[str, Any]:
        """The numbers as a dictionary, ready for JSON."""
        low, high = self.interval()
        return {
            "within": self.within,
            "breaks": self.breaks,
            "seen": self.seen,
            "expected": self.expected,
            "p": self.p_value,
            "share": self.share,
            "low": low,
            "high": high,
            "variance_factor": self.variance_factor,
            "is_asked_for": self.is_asked_for,
            "pairs": [{"first": a, "second": b, "seen": n} for (a, b), n in self.pairs.items()],
            "sentence": self.sentence,
        }


def _variance_factor(share: float) -> float:
    return (1 + 3 * share) / (1 + share)


def double_breaks(fit: RateFit, paths: Iterable[JumpPath], within: float) -> DoubleBreaks:
    """Count breaks that follow another one closely.

    fit : of a break model; gives the breaks and, by their propensities in the states after each, what chance gives
    within : tu; two steps of the mechanics for the two bodies of one collision, which may part a step apart

    A fragment that breaks again at once counts as well: a path does not tell bodies of one species apart.
    """
    if not within > 0:
        raise ValueError(f"within = {within}; expected a time above 0, such as two steps of the mechanics")
    breaks = seen = 0
    expected = 0.0
    pairs: Counter[tuple[str, str]] = Counter()
    chosen = list(fit.likelihood.channels)
    for path in paths:
        is_break = np.isin(path.channels, chosen)
        times = path.times[is_break]
        breaks += times.size
        if not times.size:
            continue
        # Each break opens a window, which the next break, a restart or the end of the run may close.
        stop = np.append(path.times[path.channels == RESTART], path.end)
        segment = np.cumsum(path.channels == RESTART)[is_break]
        following = np.append(times[1:], np.inf)
        is_same = np.append(segment[1:] == segment[:-1], False)
        is_second = is_same & (following - times <= within * (1 + ROUNDING))
        seen += int(is_second.sum())
        closed = np.minimum(np.where(is_same, following, stop[segment]), times + within)
        expected += float((_hazard(fit, path, closed) - _hazard(fit, path, times)).sum())
        names = [path.network.channels[c] for c in path.channels[is_break]]
        pairs.update((names[i], names[i + 1]) for i in np.flatnonzero(is_second))
    return DoubleBreaks(within, breaks, seen, expected, dict(pairs))


def _hazard(fit: RateFit, path: JumpPath, times: Floats) -> Floats:
    """Breaks (n,) that the fit expects from the start of a run until each of these times."""
    begin, end, _ = sojourns(path)
    gathered: Floats = np.append(0.0, np.cumsum(fit.integrated_hazards(path).sum(axis=1)))
    return np.interp(times, np.append(begin, end[-1]), gathered)
