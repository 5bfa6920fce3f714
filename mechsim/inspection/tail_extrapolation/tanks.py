"""Do tanks of different size and crowding agree on the rates of hits that are pooled over them?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinetics.runs import BY_WALL
from kinetics.support.packages import stats
from mechsim.inspection.tail_extrapolation.loads import Loads

FEWEST_HITS = 20  # expected in a tank that is compared
ALARM = 0.01  # that any of the rows is doubted by chance


@dataclass(frozen=True)
class TankRow:
    """Hits on one species by one source, tank by tank, at the log's own level.

    tanks : number compared; least, most : the extreme rates by exposure, over the rate of all tanks; where : theirs
    p : of an F test, the scatter between tanks beside that between runs of one tank
    """

    species: str
    source: str
    tanks: int
    least: float
    least_where: str
    most: float
    most_where: str
    p: float


def compare_tanks(runs: Sequence[Loads], tanks: Sequence[str], alpha: float) -> list[TankRow]:
    """Rates of hits by bodies (weighted by size^alpha) and by walls compared between tanks; none where all are alike.

    runs : the logs of single runs; tanks : of each, the name of its kind of tank

    Quasi-Poisson: Pearson's statistic between tanks over the one within them, each by its degrees of freedom
    (McCullagh & Nelder, Generalized Linear Models, 1989, section 4.5).
    """
    kind = np.unique(tanks, return_inverse=True)[1]
    names = np.unique(tanks)
    weights = runs[0].sizes.astype(float) ** alpha
    rows = []
    for s in np.flatnonzero(runs[0].sizes > 1):
        for source in ("bodies", "walls"):
            is_wall = source == "walls"
            hits = np.array([((run.struck == s) & ((run.partner == BY_WALL) == is_wall)).sum() for run in runs], float)
            exposure = np.array([run.walls[s] if is_wall else run.pairs[s] @ weights for run in runs])
            if not hits.any():
                continue
            by_tank = np.bincount(kind, hits, len(names)), np.bincount(kind, exposure, len(names))
            kept = by_tank[1] * hits.sum() / exposure.sum() >= FEWEST_HITS
            seen, whole = by_tank[0][kept], by_tank[1][kept]
            mine = kept[kind] & (exposure > 0)
            freedom = int(mine.sum()) - len(seen)
            if len(seen) < 2 or freedom < 1:
                continue
            rate, own = seen.sum() / whole.sum(), by_tank[0] / np.where(kept, by_tank[1], 1.0)
            between = ((seen - rate * whole) ** 2 / (rate * whole)).sum() / (len(seen) - 1)
            expected = own[kind[mine]] * exposure[mine]
            within = ((hits[mine] - expected) ** 2 / np.where(expected > 0, expected, 1.0)).sum() / freedom
            p = float(stats.f.sf(between / within, len(seen) - 1, freedom)) if within > 0 else 1.0
            ratio, places = seen / whole / rate, names[kept]
            low, high = int(ratio.argmin()), int(ratio.argmax())
            rows.append(
                TankRow(
                    runs[0].species[s], source, len(seen), float(ratio[low]), str(places[low]), float(ratio[high]),
                    str(places[high]), p,
                )
            )  # fmt: skip
    return rows


def tank_doubts(rows: Sequence[TankRow]) -> list[str]:
    """Rates that no one number tells for all tanks, after Bonferroni's correction for the number of rows."""
    return [
        f"hits on {row.species} by {row.source} differ between tanks (p = {row.p:.1g}): from {row.least:.2f} times the "
        f"rate of all ({row.least_where}) to {row.most:.2f} times ({row.most_where})"
        for row in rows
        if row.p * len(rows) < ALARM
    ]
