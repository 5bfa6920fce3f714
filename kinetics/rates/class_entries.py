"""Entries of a rates file by class: a constant with its evidence, pooled, widened to classes that no run had."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.class_keys import more_general, number_touched
from kinetics.rates.measured import MeasuredRate
from kinetics.support.arrays import Floats
from kinetics.support.intervals import exact_limits
from kinetics.support.settings import validated

UNTOLD = 2.0  # events: what all evidence of places where as many faces meet says of places where it is another number


class ClassRate(MeasuredRate):
    """Rate constant of one class.

    events : not whole where classes that differ were pooled: what the evidence is then worth
    exposures : of a break whose model has a shape that is not known, the exposure to bodies of 1, 2, ... cubes, to the
        wall and to no partner; `exposure` is their sum, weighted as the model weights them
    exposure_by_shape : the same as exposure at each point of the shape's posterior, where partners are species

    >>> from kinetics.rates import ClassRate, ClassRates
    >>> join = ClassRate(rate=0.02, events=2, exposure=100.0)
    >>> rates = ClassRates(classes={"join": join, "break": ClassRate(rate=1.0)})
    >>> rates.classes["join"].events, rates.classes["break"].exposure is None
    (2.0, True)
    """

    exposures: tuple[float, ...] | None = None
    exposure_by_shape: tuple[float, ...] | None = None

    def exposure_at(self, breaks: BreakTerms, points: Floats, name: str) -> Floats | None:
        """Exposure (G,) at shapes (G, S) of the break model; None if it does not depend on them.

        ValueError: it is known at the points of the shape's posterior alone, and another shape is asked for.
        """
        if self.exposures is not None:
            sizes = np.arange(1.0, len(self.exposures) - 1)
            shapes = [dict(zip(breaks.shape, point, strict=True)) for point in points.tolist()]
            weights = (breaks.break_model.by_size(sizes, shape) for shape in shapes)
            by_size = np.array([np.append(bodies, fixed) for bodies, *fixed in weights])
            return np.asarray(by_size @ np.array(self.exposures))
        if self.exposure_by_shape is None or breaks.posterior is None:
            return None
        known = dict(zip(breaks.posterior.points, self.exposure_by_shape, strict=True))
        if any(tuple(point) not in known for point in points.tolist()):
            raise ValueError(
                f"{name}: its exposure is known only at the points of the shape's posterior; use calibrate classes to "
                f"get exposures to bodies by size"
            )
        return np.array([known[tuple(point)] for point in points.tolist()])


def sums(entries: Sequence[ClassRate]) -> tuple[float, float]:
    """All events and all exposure."""
    return sum(entry.events or 0.0 for entry in entries), sum(entry.exposure or 0.0 for entry in entries)


def general_entries(entries: Mapping[str, ClassRate]) -> dict[str, ClassRate]:
    """Entries for all keys that are more general than these, each over its members, see `over_classes`.

    Members at which as many faces meet say little of places where it is another number, however they agree: such
    evidence of all joins is worth `UNTOLD` events, draws of which lie between a sixth and 2.6 times the rate (95 %).

    >>> from kinetics.rates import general_entries, measured_class
    >>> known = {f"break {n} f1 + 2 f1": measured_class(0.1, events=10, exposure=100.0) for n in (1, 2)}
    >>> {key: (entry.events, entry.exposure) for key, entry in general_entries(known).items()}
    {'break f1 + f1': (20.0, 200.0), 'break': (20.0, 200.0)}
    """
    members: dict[str, dict[str, ClassRate]] = defaultdict(dict)
    for key, entry in entries.items():
        for other in more_general(key):
            members[other][key] = entry
    found = {}
    for key, some in members.items():
        is_told = number_touched(key) is not None or len(set(map(number_touched, some))) > 1
        found[key] = over_classes(list(some.values()), math.inf if is_told or key != "join" else UNTOLD)
    return found


def over_classes(entries: Sequence[ClassRate], at_most: float = math.inf) -> ClassRate:
    """One entry for several classes: their mean, with the evidence that their scatter leaves of it, `at_most` events.

    Draws from it are those of the rate of a class that was not measured: of the classes' mean, and of the variance
    between them beyond that of counting (by moments, as DerSimonian & Laird 1986, doi:10.1016/0197-2456(86)90046-2).
    """
    if any(entry.exposure is None for entry in entries):
        return ClassRate(rate=float(np.mean([entry.rate for entry in entries])))
    events, exposure = sums(entries)
    rate = events / exposure
    between = _variance_between(entries)
    if rate == 0 or (between == 0 and events <= at_most):
        return measured_class(rate, events, exposure, **parts_of(entries, 1.0))
    worth = rate**2 / (between + rate / exposure)  # events of a gamma distribution as wide
    kept = min(max(worth - 0.5, 0.0), at_most)  # Jeffreys' prior adds the half
    part = (kept + 0.5) / events
    return measured_class(rate, kept, part * exposure, **parts_of(entries, part))


def with_prior(entry: ClassRate, prior: ClassRate) -> ClassRate:
    """The evidence of a class, and that of an entry over classes like it: the sum of events and of exposures.

    A draw is then Gamma(events of its own + a, exposure of its own + b), where Gamma(a, b) is that of the prior.

    >>> from kinetics.rates import measured_class, with_prior
    >>> entry = with_prior(measured_class(0.0, events=0, exposure=10.0), measured_class(0.1, events=2.0, exposure=25.0))
    >>> entry.events, entry.exposure, round(entry.rate, 6)  # (2 + 1/2) / 35
    (2.0, 35.0, 0.071429)
    """
    if entry.events is None or entry.exposure is None or prior.events is None or prior.exposure is None:
        return entry
    events, exposure = entry.events + prior.events, entry.exposure + prior.exposure
    return measured_class((events + 0.5) / exposure, events, exposure, **parts_of([entry, prior], 1.0))


def _variance_between(entries: Sequence[ClassRate]) -> float:
    """Variance of the rates of several classes beyond what counting gives, 0 or more."""
    n = np.array([entry.events for entry in entries], dtype=float)
    exposure = np.array([entry.exposure for entry in entries], dtype=float)
    total = exposure.sum()
    rate = n.sum() / total
    seen = float(((n - exposure * rate) ** 2).sum())
    second, third = float((exposure**2).sum()), float((exposure**3).sum())
    by_counting = rate * (total - second / total)
    weight = second - 2 * third / total + (second / total) ** 2
    return max(seen - by_counting, 0.0) / weight if weight > 0 else 0.0


def parts_of(entries: Sequence[ClassRate], part: float) -> dict[str, tuple[float, ...]]:
    """Part of all exposure, partner by partner and at each point of the shape's posterior, as far as all have it."""
    found: dict[str, tuple[float, ...]] = {}
    for name in ("exposures", "exposure_by_shape"):
        known = [value for entry in entries if (value := getattr(entry, name)) is not None]
        if len(known) == len(entries):
            found[name] = tuple(float(f"{value:.6g}") for value in part * np.sum(known, axis=0))
    return found


def measured_class(rate: float, events: float, exposure: float, **parts: tuple[float, ...]) -> ClassRate:
    """A class rate with its exact interval (Garwood 1936, doi:10.1093/biomet/28.3-4.437).

    For an entry of several classes, the interval is stretched to hold their mean.

    parts : `exposures` or `exposure_by_shape`, where there are any

    >>> from kinetics.rates import measured_class
    >>> entry = measured_class(0.02, events=4, exposure=200.0)
    >>> round(entry.low, 4), round(entry.high, 4)
    (0.0054, 0.0512)
    """
    low, high = map(float, exact_limits(events, exposure))
    limits = {"low": min(low, rate), "high": max(high, rate)}
    return validated(ClassRate, {"rate": rate, "events": events, "exposure": exposure} | limits | parts, "a class")
