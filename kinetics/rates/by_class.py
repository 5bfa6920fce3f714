"""Rate constants by rate class, so that one measurement serves every book that has ways of that class.

The ways of a channel are sorted by what happens, how many faces meet, the face types and the sizes of the two sides
(`RateClass`). A file gives constants from the particular to the general (`class_keys`), and the most particular one
that fits counts.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from msgspec import Meta, field
from msgspec.structs import force_setattr

from kinetics.network import Network
from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.breaks import Expansion
from kinetics.rates.class_keys import are_by_class, class_keys, more_general, number_touched, plain_key
from kinetics.rates.rates import ChannelRate, Convention, MeasuredRate, Rates
from kinetics.support.arrays import Floats
from kinetics.support.config import read_toml, write_toml
from kinetics.support.intervals import exact_limits, posterior_draws
from kinetics.support.settings import Settings, validated

if TYPE_CHECKING:
    from kinetics.assembly import Derivation, RateClass

DISTINCT = Convention(combinations="distinct", time_unit="tu")
UNTOLD = 2.0  # events: what all evidence of places where as many faces meet says of places where it is another number


class ClassRate(MeasuredRate):
    """Rate constant of one class.

    events : not whole where classes that differ were pooled: what the evidence is then worth
    exposures : of a break whose model has a shape that is not known, the exposure to bodies of 1, 2, ... cubes, to the
        wall and to nobody; `exposure` is their sum, weighted as the model weights them
    exposure_by_shape : the same as exposure at each point of the shape's posterior, where partners are species

    >>> from kinetics.rates import ClassRate, ClassRates
    >>> join = ClassRate(rate=0.02, events=2, exposure=100.0)
    >>> rates = ClassRates(classes={"join": join, "break": ClassRate(rate=1.0)})
    >>> rates.classes["join"].events, rates.classes["break"].exposure is None
    (2.0, True)
    """

    exposures: tuple[float, ...] | None = None
    exposure_by_shape: tuple[float, ...] | None = None


class ClassRates(Settings):
    """Rate constants by rate class, with fallbacks from the particular to the general.

    classes : key -> ClassRate; a key is a class as it is printed, the same without sizes, or the kind of event alone
    faces : the face scheme that the face types belong to; None: any
    tank : edges of the tank in which the constants hold; None: not known
    breaks : the break model; the constant of a break is its coefficient, per partner of weight 1
    evidence : table of free form that says where the rates come from

    >>> from kinetics import ClassRates
    >>> from kinetics.assembly import RuleBook, derive
    >>> line = derive(RuleBook.load("line4"))
    >>> network = ClassRates.uniform(join=1e-4, break_=1e-3).apply(line)
    >>> sorted(set(network.rate_constants.tolist()))
    [0.0001, 0.001]
    """

    convention: Convention = DISTINCT
    faces: str | None = None
    tank: tuple[float, float, float] | None = None
    breaks: BreakTerms = BreakTerms()
    classes: Annotated[dict[str, ClassRate], Meta(min_length=1)]
    evidence: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keys with the smaller side first, as classes are printed."""
        found: dict[str, ClassRate] = {}
        for written, entry in self.classes.items():
            key = plain_key(written)
            if key in found:
                raise ValueError(f"classes: {key!r} is there twice, once written as {written!r}; keep one of them")
            found[key] = entry
        force_setattr(self, "classes", found)

    @classmethod
    def load(cls, path: str | Path) -> ClassRates:
        """Read a TOML file with a table `classes`."""
        source = Path(path)
        if not source.exists():
            raise ValueError(f"class rates file {source} does not exist; give the path of a TOML file")
        return validated(cls, read_toml(source), source)

    @classmethod
    def fitting(cls, name_or_path: str | Path, derivations: Iterable[Derivation]) -> ClassRates:
        """Class rates from a file of them, or from the rates of a network, which are split by the classes of its book.

        derivations : candidates for that network; they are made one by one until one fits
        """
        if are_by_class(name_or_path):
            return cls.load(name_or_path)
        rates = Rates.load(name_or_path)
        tried = []
        for derivation in derivations:
            try:
                return cls.of_rates(derivation, rates)
            except ValueError as error:
                tried.append(f"{derivation.book.name}: {error}")
        raise ValueError(
            f"the rates {name_or_path} belong to the network of a book that is not here; name that book, or give rates "
            f"by class. Tried {'; '.join(tried) or 'none'}"
        )

    def save(self, path: str | Path) -> None:
        """Write as TOML, whole or not at all."""
        write_toml(self.as_dict(none=False), Path(path))

    @classmethod
    def uniform(cls, join: float, break_: float = 0.0) -> ClassRates:
        """One rate constant for every join and one for every break, 1/tu; 0: it never happens."""
        return validated(cls, {"classes": {"join": {"rate": join}, "break": {"rate": break_}}}, "uniform rates")

    @classmethod
    def of_rates(cls, derivation: Derivation, rates: Rates) -> ClassRates:
        """The constants of all classes of a network, from the rates of its channels.

        Channels of one class are pooled: events over exposure, or without evidence the mean weighted by their ways.
        Where the file counts ways differently from geometry, the factor goes into the constant, so that propensities
        stay as they are. A channel whose ways belong to several classes gives each of them its own rate; it counts
        only for classes to which no other channel belongs alone.

        For every pair of faces and number touched an entry without sizes is added, see `general_entries`; faces and
        numbers of which the network has none have no rate.
        """
        base = rates.expansion(derivation.network).base
        at_shapes = rates.breaks.at_shapes(base)
        alone: dict[RateClass, list[_Share]] = defaultdict(list)
        shared: dict[RateClass, list[_Share]] = defaultdict(list)
        for name, ways in zip(base.channels, derivation.events.values(), strict=True):
            for rate_class, n in ways.items():
                share = _Share.by(rates.channels[name], n, sum(ways.values()), at_shapes)
                (alone if len(ways) == 1 else shared)[rate_class].append(share)
        by_class = {c: _pooled(alone.get(c) or shared[c]) for c in derivation.rate_classes}
        known = {str(c): entry for c, entry in by_class.items()}
        of_faces = {class_keys(c)[1] for c in by_class}
        general = {key: entry for key, entry in general_entries(known).items() if key in of_faces}
        return cls(
            convention=rates.convention,
            faces=derivation.book.scheme,
            tank=rates.tank,
            breaks=rates.breaks,
            classes=known | general,
            evidence=rates.evidence,
        )

    def key(self, rate_class: RateClass) -> str:
        """The key of the entry from which a class takes its constant; a ValueError names a class without one."""
        keys = tuple(dict.fromkeys(class_keys(rate_class)))
        for key in keys:
            if key in self.classes:
                return key
        raise ValueError(
            f"no rate for class {keys[0]!r}; add it, or one of the more general {', '.join(map(repr, keys[1:]))}; "
            f"there are {', '.join(map(repr, self.classes))}"
        )

    def rate(self, rate_class: RateClass) -> float:
        """Rate constant of a class, 1/tu per way and combination."""
        return self.classes[self.key(rate_class)].rate

    def apply(self, derivation: Derivation) -> Network:
        """The derived network with rates, its breaks expanded by their partners, in the tank of the constants.

        The constant of a channel is the mean over its classes, weighted by their ways.
        """
        base = self.base(derivation)
        self.breaks.check(base)
        expansion = Expansion.of(base, self.breaks.break_model)
        return expansion.network.with_rates(expansion.constants(base.known_rates, self.breaks.weights(base)))

    def base(self, derivation: Derivation) -> Network:
        """The same with one channel a break, which has its coefficient."""
        if self.faces not in (None, derivation.book.scheme):
            raise ValueError(
                f"these class rates are for faces = {self.faces!r}; book {derivation.book.name!r} has "
                f"{derivation.book.scheme!r}, whose face types mean something else"
            )
        bare = derivation.network
        constants = {rate_class: self.rate(rate_class) for rate_class in derivation.rate_classes}
        totals = [sum(n * constants[c] for c, n in ways.items()) for ways in derivation.events.values()]
        return bare.with_rates(np.divide(totals, bare.ways), combinations=self.convention.combinations)

    def draws(self, rng: np.random.Generator, n: int) -> list[ClassRates]:
        """n sets of rates; within a set, all channels that share an entry vary together.

        They come from Gamma(events + 1/2, exposure), the posterior under Jeffreys' prior, or are the point rate where
        there is no evidence.
        """
        known = list(self.classes.values())
        table = posterior_draws(rng, n, [c.rate for c in known], [c.events for c in known], [c.exposure for c in known])
        points, drawn = self.breaks.shape_draws(rng, n)
        for column, entry in enumerate(known):
            by_shape = self._by_shape(entry)
            if by_shape is not None and entry.exposure is not None:
                table[:, column] *= entry.exposure / by_shape[points]
        return [
            self.replace(
                classes={key: ClassRate(rate=k) for key, k in zip(self.classes, row, strict=True)}, breaks=breaks
            )
            for row, breaks in zip(table.tolist(), drawn, strict=True)
        ]

    def _by_shape(self, entry: ClassRate) -> Floats | None:
        """Exposure (G,) of an entry at each point of the shape's posterior; None where it does not depend on it."""
        if entry.exposures is None or self.breaks.posterior is None:
            return None if entry.exposure_by_shape is None else np.array(entry.exposure_by_shape)
        sizes = np.arange(1.0, len(entry.exposures) - 1)
        shapes = [dict(zip(self.breaks.shape, point, strict=True)) for point in self.breaks.posterior.points]
        weights = (self.breaks.break_model.by_size(sizes, shape) for shape in shapes)
        return np.array([np.append(bodies, fixed) for bodies, *fixed in weights]) @ np.array(entry.exposures)

    def without_evidence(self, classes: Iterable[RateClass]) -> list[str]:
        """The keys used by these classes whose rates have no events and exposure."""
        used = dict.fromkeys(map(self.key, classes))
        return [key for key in used if self.classes[key].exposure is None]


class _Share(NamedTuple):
    """The evidence of one channel for one class, its ways counted by geometry."""

    ways: float
    entry: ClassRate

    @classmethod
    def by(cls, channel: ChannelRate, ways: float, all_ways: float, at_shapes: Floats | None) -> _Share:
        """By a channel of which `ways` of `all_ways` are of the class; evidence is shared out by ways."""
        scale, share = channel.ways / all_ways, ways / all_ways
        by_shape = None
        if at_shapes is not None and channel.exposures is not None:
            by_shape = tuple((at_shapes @ channel.exposures * (share / scale)).tolist())
        entry = ClassRate(
            rate=channel.rate * scale,
            low=None if channel.low is None else channel.low * scale,
            high=None if channel.high is None else channel.high * scale,
            events=None if channel.events is None else channel.events * share,
            exposure=None if channel.exposure is None else channel.exposure * share / scale,
            exposure_by_shape=by_shape,
        )
        return cls(ways, entry)


def _pooled(shares: list[_Share]) -> ClassRate:
    """The evidence of all channels for one class, taken together."""
    entries = [entry for _, entry in shares]
    if len(entries) == 1:
        return entries[0]
    if all(entry.exposure is not None for entry in entries):
        events, exposure = _sums(entries)
        return measured_class(events / exposure, events, exposure, **_parts(entries, 1.0))
    weights = [ways for ways, _ in shares]
    return ClassRate(rate=float(np.average([entry.rate for entry in entries], weights=weights)))


def _sums(entries: Sequence[ClassRate]) -> tuple[float, float]:
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
    events, exposure = _sums(entries)
    rate = events / exposure
    between = _variance_between(entries)
    if rate == 0 or (between == 0 and events <= at_most):
        return measured_class(rate, events, exposure, **_parts(entries, 1.0))
    worth = rate**2 / (between + rate / exposure)  # events of a gamma distribution as wide
    kept = min(max(worth - 0.5, 0.0), at_most)  # Jeffreys' prior adds the half
    part = (kept + 0.5) / events
    return measured_class(rate, kept, part * exposure, **_parts(entries, part))


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
    return measured_class((events + 0.5) / exposure, events, exposure, **_parts([entry, prior], 1.0))


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


def _parts(entries: Sequence[ClassRate], part: float) -> dict[str, tuple[float, ...]]:
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
