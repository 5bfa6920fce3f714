"""One test of joins and breaks of all held-out runs together: one p-value, which wrong rates everywhere make small."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibration.estimating.joins_and_breaks import WHOLES
from calibration.validating.events import EventTotals, HeldOutEvents
from calibration.validating.power import LEVEL, OFF_BY, Power, power_of_runs
from calibration.validating.predictive import upper_p
from calibration.validating.verdict import ConsistencyCheck, Verdict, judged
from kinetics.support.arrays import Floats, divided

MOST = 1e6  # seen / expected of events that the rates call impossible
OFF_GROUPS = 50  # simulated for each sign of an error, to learn the power: known to .14 (two standard errors)


def misfits(seen: Floats, simulated: Floats) -> tuple[float, Floats]:
    """How far apart rows are from what is usual, all rows together: of `seen` (K,) and of `simulated` (D, K).

    The sum over rows of squared distances from the row's mean over all D + 1 groups, in standard deviations; square
    roots of the values are taken first, which makes the spread of counts even. All groups are treated alike, and
    simulated groups of one number share their draw of the rates over all rows, as the held-out runs share the true
    rates; so where the model holds, the misfit seen is one of D + 1 exchangeable ones, however rows depend on each
    other.
    """
    roots = np.sqrt(np.minimum(np.vstack([seen, simulated]), MOST))
    away = divided(roots - roots.mean(axis=0), roots.std(axis=0))
    found = (away**2).sum(axis=1)
    return float(found[0]), found[1:]


class Overall:
    """The test of all rows: those of joins and of breaks of each experiment, or of all channels where there are none.

    p, least : share of simulated groups, the runs held out included, with at least their misfit; the smallest possible
    """

    def __init__(self, held_out: Sequence[HeldOutEvents]) -> None:
        self.held_out = tuple(held_out)
        names = held_out[0].names
        self.columns = [g for g, name in enumerate(names) if name in WHOLES] or list(range(len(names)))
        self.simulated = self._ratios([each.first_totals for each in held_out])
        seen, others = misfits(self._ratios([each.observed for each in held_out])[0], self.simulated)
        self.p, self.least = upper_p(seen, others), 1 / (len(others) + 1)

    def power(self, group: str, off_by: float = OFF_BY, level: float = LEVEL) -> float:
        """Probability of p <= level where all rates of a group of channels are off by this share, up or down.

        The smaller of the two, from OFF_GROUPS simulated groups each.
        """
        column = self.held_out[0].names.index(group)
        found = []
        for part, factor in enumerate((1 - off_by, 1 + off_by)):
            off = [each.totals_off(group, factor, OFF_GROUPS, 2 * column + part) for each in self.held_out]
            found.append(float(np.mean([self._p(row) <= level for row in self._ratios(off)])))
        return min(found)

    def _p(self, row: Floats) -> float:
        return upper_p(*misfits(row, self.simulated))

    def _ratios(self, parts: Sequence[EventTotals]) -> Floats:
        """Seen / expected (D, K), experiment by experiment."""
        return np.concatenate([part.ratio[:, self.columns] for part in parts], axis=1)


def overall_verdict(held_out: Sequence[HeldOutEvents], where: str, details: Sequence[ConsistencyCheck]) -> Verdict:
    """The verdict on all rows together, and what these runs would have shown; `where` : which runs, as text."""
    overall = Overall(held_out)
    wholes = [name for name in held_out[0].names if name in WHOLES]
    powers = [Power(group, OFF_BY, power_of_runs(held_out, group).power(), overall.power(group)) for group in wholes]
    what = f"{' and '.join(wholes) or 'events'} {where}"
    return judged([ConsistencyCheck(what, overall.p, overall.least)], powers, details)
