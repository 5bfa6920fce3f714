"""How surely held-out growth shows that class rates are off, by growth simulated at rates that are."""

from __future__ import annotations

from collections.abc import Callable

from calibration.validating.power import LEVEL, OFF_BY, Power
from kinetics.rates import ClassRates
from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import stats

KINDS = {"joins": "join", "breaks": "break"}  # rows of events -> how the keys of their classes begin


def scaled(rates: ClassRates, event: str, factor: float) -> ClassRates:
    """The rates with those of all joins, or of all breaks, and their evidence moved by a factor."""
    classes = dict(rates.classes)
    for key, entry in rates.classes.items():
        if key.split()[0] != event:
            continue
        moved: dict[str, object] = {
            name: None if value is None else value * factor
            for name, value in (("rate", entry.rate), ("low", entry.low), ("high", entry.high))
        }
        moved["exposure"] = None if entry.exposure is None else entry.exposure / factor
        for name in ("exposures", "exposure_by_shape"):
            parts = getattr(entry, name)
            moved[name] = None if parts is None else tuple(part / factor for part in parts)
        classes[key] = entry.replace(**moved)
    return rates.replace(classes=classes)


def growth_powers(
    rates: ClassRates,
    totals: Floats,
    simulated: Callable[[ClassRates, int], Ints],
    checks: int,
    off_by: float = OFF_BY,
) -> tuple[Power, ...]:
    """Of joins and breaks, where there are any: how surely their number shows rates that are off.

    totals : (groups, 2) joins and breaks of predicted groups of as many runs as were held out
    simulated : the same of some groups at given rates, with a seed of their own
    checks : of the verdict, which corrects for their number

    Numbers of events are taken as normal, with the mean and the spread of the simulated groups: approximate, and where
    few events are expected by a few hundredths. The smaller power of rates that are too low and too high counts.
    """
    found = []
    for column, (kind, event) in enumerate(KINDS.items()):
        if not totals[:, column].any():
            continue
        off = [simulated(scaled(rates, event, 1 + sign * off_by), 2 * column + n)[:, column].astype(float)
               for n, sign in enumerate((-1, 1))]  # fmt: skip
        in_row, in_verdict = (
            min(_beyond(totals[:, column], each, level) for each in off) for level in (LEVEL, LEVEL / checks)
        )
        found.append(Power(kind, off_by, in_row, in_verdict))
    return tuple(found)


def _beyond(supposed: Floats, true: Floats, level: float) -> float:
    """Probability that a number like the true ones lies where numbers like the supposed ones do with this one."""
    half = float(stats.norm.isf(level / 2)) * supposed.std(ddof=1)
    middle, mean, sd = supposed.mean(), true.mean(), true.std(ddof=1)
    if sd == 0:
        return float(abs(mean - middle) > half)
    return float(stats.norm.cdf((middle - half - mean) / sd) + stats.norm.sf((middle + half - mean) / sd))
