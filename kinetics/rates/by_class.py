"""Rate constants by rate class, so that one measurement serves every book that has ways of that class.

The ways of a channel are sorted by what happens, how many faces meet, the face types and the sizes of the two sides
(`RateClass`). A file gives constants from the particular to the general (`class_keys`), and the most particular one
that fits counts.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from msgspec import Meta, field
from msgspec.structs import force_setattr

from kinetics.network import Network
from kinetics.rates.applied import MeasuredRates
from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.breaks import Expansion
from kinetics.rates.class_entries import ClassRate, general_entries, measured_class, parts_of, sums
from kinetics.rates.class_keys import are_by_class, class_keys, plain_key
from kinetics.rates.measured import MeasuredRate
from kinetics.rates.rates import ChannelRate, Convention, Rates
from kinetics.support.arrays import Floats
from kinetics.support.config import read_toml, write_toml
from kinetics.support.intervals import posterior_draws
from kinetics.support.settings import Settings, validated

if TYPE_CHECKING:
    from kinetics.assembly import Derivation, RateClass

DISTINCT = Convention(combinations="distinct", time_unit="tu")


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
                raise ValueError(f"classes: {key!r} appears twice, once as {written!r}; keep one of them")
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
            f"the rates {name_or_path} belong to the network of another book; name that book, or give rates by "
            f"class. Tried {'; '.join(tried) or 'none'}"
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
        numbers of which the network has none have no rate. ValueError: rates that depend on how crowded the tank is
        """
        if rates.crowding is not None:
            raise ValueError(
                "these rates depend on how crowded the tank is, and rates by class do not: calibrate with "
                "--crowding none"
            )
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
        return BookRates(self, derivation).apply(derivation.network)

    def base(self, derivation: Derivation) -> Network:
        """The derived network with rates and one channel a break, whose rate is its coefficient."""
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
            by_shape = None
            if self.breaks.posterior is not None:
                by_shape = entry.exposure_at(self.breaks, np.array(self.breaks.posterior.points), "")
            if by_shape is not None and entry.exposure is not None:
                table[:, column] *= entry.exposure / by_shape[points]
        return [
            self.replace(
                classes={key: ClassRate(rate=k) for key, k in zip(self.classes, row, strict=True)}, breaks=breaks
            )
            for row, breaks in zip(table.tolist(), drawn, strict=True)
        ]

    def without_evidence(self, classes: Iterable[RateClass]) -> list[str]:
        """The keys used by these classes whose rates have no events and exposure."""
        used = dict.fromkeys(map(self.key, classes))
        return [key for key in used if self.classes[key].exposure is None]


@dataclass(frozen=True, eq=False)
class BookRates(MeasuredRates):
    """Class rates in the derived network of one book.

    rates : by class
    derivation : of the book

    ValueError: faces of another scheme, or a class of the book without a rate.

    >>> from kinetics.assembly import RuleBook, derive
    >>> from kinetics.rates import BookRates, ClassRates
    >>> line = derive(RuleBook.load("line4"))
    >>> rates = BookRates(ClassRates.uniform(join=1e-4, break_=1e-3), line)
    >>> rates.has_evidence, sorted(set(rates.apply(line.network).rate_constants.tolist()))
    (False, [0.0001, 0.001])
    """

    rates: ClassRates
    derivation: Derivation

    @property
    def convention(self) -> Convention:
        """The convention by which propensities count combinations."""
        return self.rates.convention

    @property
    def breaks(self) -> BreakTerms:  # type: ignore[override]
        """The break model of the rates."""
        return self.rates.breaks

    @property
    def tank(self) -> tuple[float, float, float] | None:  # type: ignore[override]
        """Edges of the tank in which the rates were measured."""
        return self.rates.tank

    def expansion(self, network: Network) -> Expansion:
        """The book's network with these rates as they stand, and what the break model makes of it.

        ValueError: the network of another book.
        """
        if network.fingerprint != self.derivation.network.fingerprint:
            raise ValueError(f"these rates are for the network of book {self.derivation.book.name!r}, not for this one")
        return self._expansion

    @cached_property
    def _expansion(self) -> Expansion:
        base = self.rates.base(self.derivation)
        self.breaks.check(base)
        return Expansion.of(base, self.breaks.break_model)

    def known(self, network: Network) -> tuple[dict[str, MeasuredRate], Floats]:  # noqa: ARG002
        """The entries that the book uses. All channels that take an entry vary together."""
        return {key: self.rates.classes[key] for key in self._keys}, self._shares

    @property
    def has_evidence(self) -> bool:
        """Whether any entry that the book uses has events and exposure."""
        return len(self.without_evidence()) < len(self._keys)

    def without_evidence(self) -> list[str]:
        """The entries that the book uses and that have no events and exposure."""
        return self.rates.without_evidence(self.derivation.rate_classes)

    @cached_property
    def _keys(self) -> tuple[str, ...]:
        used = set(map(self.rates.key, self.derivation.rate_classes))
        return tuple(key for key in self.rates.classes if key in used)

    @cached_property
    def _shares(self) -> Floats:
        places = {key: k for k, key in enumerate(self._keys)}
        table = np.zeros((len(self.derivation.events), len(places)))
        for row, ways in zip(table, self.derivation.events.values(), strict=True):
            for rate_class, n in ways.items():
                row[places[self.rates.key(rate_class)]] += n
        return np.asarray(table / self.derivation.network.ways[:, None])


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
        events, exposure = sums(entries)
        return measured_class(events / exposure, events, exposure, **parts_of(entries, 1.0))
    weights = [ways for ways, _ in shares]
    return ClassRate(rate=float(np.average([entry.rate for entry in entries], weights=weights)))
