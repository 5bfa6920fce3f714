"""Whether one rate constant serves all that is pooled in it: by structure, by sizes, by cubes that a place touches.

Given its exposure, each group of channels has its part of the events of a constant by the exposures alone. The test
asks whether the parts seen are out of the ordinary among multinomial ones: by the likelihood ratio, whose law is
simulated; groups of few events are taken together. Exposures that follow from the events make it approximate.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.estimating.class_calibration import BookRuns, ClassCalibration, ClassFit
from kinetics.assembly import Derivation
from kinetics.rates import class_keys
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import special

SIMULATED = 9999  # studies without spread, for the p-value
STUDIES = 400  # with spread, for the power
SPREAD = 0.5  # relative standard deviation of the rates of groups for which the power is given
LEVEL = 0.01
FEWEST = 5  # events seen or expected, on average, of a group of its own
OTHERS = "others"  # groups that are too small to be told apart
WAYS = ("structure", "sizes", "cubes touched")


@dataclass(frozen=True, eq=False)
class ClassSpread:
    """One constant, its events told apart by one property.

    key : of the constant; by : the property, one of WAYS
    groups : (G,) values of the property; events, exposure : (G,) of each, exposure in tu
    p : of the likelihood ratio among multinomial parts; p at most a has probability a at most where one rate serves all
        and exposures are as they were
    power : probability of p <= 1 % where the rates of groups scatter by half (Gamma, relative standard deviation 0.5)
    """

    key: str
    by: str
    groups: tuple[str, ...]
    events: Ints
    exposure: Floats
    p: float
    power: float

    @property
    def sentence(self) -> str:
        """A sentence on the spread."""
        rates = [
            f"{name}: {n} in {x:.3g} tu" for name, n, x in zip(self.groups, self.events, self.exposure, strict=True)
        ]
        shown = "; ".join(rates) if len(rates) <= 4 else f"{len(rates)} groups"
        return f"{self.key} by {self.by} ({shown}): p = {self.p:.2g}, power {self.power:.2f}"

    def to_dict(self) -> dict[str, Any]:
        """The test as a dictionary, ready for JSON."""
        return vars(self) | {"events": self.events.tolist(), "exposure": self.exposure.tolist()}


def class_spreads(books: Iterable[BookRuns], calibration: ClassCalibration, seed: int = 0) -> tuple[ClassSpread, ...]:
    """Test all chosen constants that serve several groups of five events, seen or expected.

    Channels with ways of several constants are left out. Breaks count in the exposure that the fitted model gives them.
    Cost: a pass over the paths, then some 10,000 multinomial draws a test.
    """
    known: dict[tuple[str, str], dict[Hashable, Floats]] = {}
    for derivation, paths in books:
        for fit in calibration.chosen:
            keys = [_only_key(fit, ways) for ways in derivation.events.values()]
            totals = sum((_counted(fit, path) for path in paths), start=np.zeros((len(keys), 2)))
            properties = [_properties(derivation, event) for event in derivation.events]
            for key, found, row in zip(keys, properties, totals, strict=True):
                if key is not None and row[1] > 0:
                    for by, value in zip(WAYS, found, strict=True):
                        groups = known.setdefault((key, by), {})
                        groups[value] = groups.get(value, np.zeros(2)) + row
    rng = np.random.default_rng(seed)
    tested = []
    for (key, by), groups in known.items():
        names, table = _large(groups)
        if len(names) > 1:
            tested.append(_tested(key, by, names, table, rng))
    return tuple(tested)


def _large(groups: dict[Hashable, Floats]) -> tuple[tuple[str, ...], Floats]:
    """Names of groups, and events and exposure (G, 2); groups of few events, seen or expected, are pooled."""
    # Both decide. A structure that grows only once has one event, which ends its exposure: its share is not
    # multinomial. Expected events alone would select structures that happened to last long.
    table = np.array(list(groups.values()))
    events, exposure = table.sum(axis=0)

    def is_large(rows: Floats) -> Any:
        return rows[..., 0] + rows[..., 1] * events / exposure >= 2 * FEWEST

    large = is_large(table)
    names = tuple(str(group) for group, alone in zip(groups, large.tolist(), strict=True) if alone)
    rest = table[~large].sum(axis=0)
    if not is_large(rest):
        return names, table[large]
    return (*names, OTHERS), np.vstack([table[large], rest])


def flagged(spreads: Sequence[ClassSpread], level: float = LEVEL) -> tuple[ClassSpread, ...]:
    """The tests that find a spread at this level, with Holm's correction for their number."""
    ordered = sorted(spreads, key=lambda each: each.p)
    for i, each in enumerate(ordered):
        if each.p > level / (len(ordered) - i):
            return tuple(ordered[:i])
    return tuple(ordered)


def _only_key(fit: ClassFit, ways: Iterable[Any]) -> str | None:
    """The constant of a channel; None if it is of another kind, or has several."""
    known = {key for c in ways for key in class_keys(c) if key in fit.channels}
    return known.pop() if len(known) == 1 else None


def _properties(derivation: Derivation, event: Any) -> tuple[str, str, int]:
    """Properties of a channel: its largest structure, the sizes of the two sides, bonds that form or break."""
    species = derivation.network.species
    structures = list(derivation.structures.values())
    apart, whole = (event.before, event.after[0]) if len(event.before) == 2 else (event.after, event.before[0])
    sizes = sorted(len(structures[s]) for s in apart)
    bonds = len(structures[whole].bonds) - sum(len(structures[s].bonds) for s in apart)
    largest = max(event.before, key=lambda s: len(structures[s]))
    return f"{derivation.book.name} {species[largest]}", " + ".join(map(str, sizes)), bonds


def _counted(fit: ClassFit, path: JumpPath) -> Floats:
    """Events and exposure (R, 2) of each channel, ways counted, in the tank of the fit."""
    exposures, _ = fit.model.collected(path, np.zeros(0, dtype=np.int64))
    weights = fit.model.mixture()
    fired = np.bincount(path.channels[path.channels != RESTART], minlength=len(path.network.channels))
    return np.column_stack([fired, exposures[0] if weights is None else weights[0] @ exposures])


def _tested(key: str, by: str, groups: tuple[str, ...], table: Floats, rng: np.random.Generator) -> ClassSpread:
    events, exposure = table[:, 0].astype(np.int64), table[:, 1]
    part, n = exposure / exposure.sum(), int(events.sum())
    nulls = np.sort(_ratio(rng.multinomial(n, part, size=SIMULATED), part))
    scatter = part * rng.gamma(1 / SPREAD**2, size=(STUDIES, part.size))
    others = rng.multinomial(n, scatter / scatter.sum(axis=1, keepdims=True))
    p = _ranks(_ratio(events[None, :], part), nulls)[0]
    power = float((_ranks(_ratio(others, part), nulls) <= LEVEL).mean())
    return ClassSpread(key, by, groups, events, exposure, float(p), power)


def _ratio(counts: Ints, part: Floats) -> Floats:
    """Twice the log-likelihood ratio (n,) of counts (n, G) against their parts of the total."""
    total = counts.sum(axis=1, keepdims=True)
    return np.asarray(2 * (special.xlogy(counts, counts) - special.xlogy(counts, total * part)).sum(axis=1))


def _ranks(values: Floats, nulls: Floats) -> Floats:
    """P-values (n,): share of the sorted null values, and of each value itself, that are as large."""
    above = nulls.size - np.searchsorted(nulls, values * (1 - 1e-12) - 1e-12)
    return np.asarray((above + 1) / (nulls.size + 1))
