"""Rates by class in the network of one book: they answer as `Rates` do, so that predictions carry their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kinetics.network import Network, Tank
from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.breaks import Expansion
from kinetics.rates.by_class import ClassRates
from kinetics.rates.posterior import RatesPosterior
from kinetics.rates.rates import Convention
from kinetics.support.arrays import Floats

if TYPE_CHECKING:
    from kinetics.assembly import Derivation


@dataclass(frozen=True, eq=False)
class ClassPosterior(RatesPosterior):
    """What is known of the entries of a class rates file that a book uses, then of the shape parameters.

    keys : (K,) the entries; `rates`, `events`, `exposure` and `exposures` (to bodies by size, wall, nobody) are theirs
    shares : (R, K) what each entry adds to the coefficient of a channel: ways of its classes over all ways
    by_shape : exposure of each entry at the points of the shape's posterior, where that is all that is known

    All channels that take an entry vary together.
    """

    keys: tuple[str, ...]
    shares: Floats
    by_shape: tuple[tuple[float, ...] | None, ...]

    @property
    def rate_names(self) -> tuple[str, ...]:
        """The keys."""
        return self.keys

    def coefficients(self, rates: Floats) -> Floats:
        """Coefficients (n, R) of the channels, from rates (n, K)."""
        return np.asarray(rates @ self.shares.T)

    def parts(self, parameters: Floats) -> Floats:
        """The part (K, R') that each entry has in each rate constant at parameters (P,)."""
        rates, shape = np.split(parameters, [len(self.rates)])
        each = self.shares * rates * self.factors_at(shape[None, :])[0]
        each = np.where(each.any(axis=1, keepdims=True), each, self.shares)
        return np.asarray((each / each.sum(axis=1, keepdims=True)).T[:, self.expansion.base_of])

    def exposures_at(self, points: Floats) -> list[Floats | None]:
        """Exposure (G,) of each entry at shapes (G, S); None where it does not depend on them.

        ValueError: an entry whose exposure is known at the points of the posterior alone, and another shape.
        """
        model, names = self.breaks.break_model, self.breaks.shape
        shapes = [dict(zip(names, point, strict=True)) for point in points.tolist()]
        found: list[Floats | None] = []
        for key, parts, by_shape in zip(self.keys, self.exposures, self.by_shape, strict=True):
            if parts is not None:
                sizes = np.arange(1.0, len(parts) - 1)
                weighted = [np.append(bodies, fixed) for bodies, *fixed in (model.by_size(sizes, s) for s in shapes)]
                found.append(np.array(weighted) @ np.array(parts))
            elif by_shape is not None and self.breaks.posterior is not None:
                known = dict(zip(self.breaks.posterior.points, by_shape, strict=True))
                if any(tuple(point) not in known for point in points.tolist()):
                    raise ValueError(
                        f"{key}: its exposure is known at the points of the shape's posterior alone; calibrate by "
                        "class for exposures to bodies by their size"
                    )
                found.append(np.array([known[tuple(point)] for point in points.tolist()]))
            else:
                found.append(None)
        return found


@dataclass(frozen=True, eq=False)
class BookRates:
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
        """How propensities are put together."""
        return self.rates.convention

    @property
    def breaks(self) -> BreakTerms:
        """The break model."""
        return self.rates.breaks

    @property
    def measured_in(self) -> Tank | None:
        """The tank in which the rates were measured."""
        return None if self.rates.tank is None else Tank(self.rates.tank)

    @cached_property
    def expansion(self) -> Expansion:
        """The book's network with these rates as they stand, and what the break model makes of it."""
        base = self.rates.base(self.derivation)
        self.breaks.check(base)
        return Expansion.of(base, self.breaks.break_model)

    def apply(self, network: Network, tank: Tank | None = None) -> Network:
        """As `Rates.apply`; ValueError for the network of another book."""
        self._check(network)
        expansion = self.expansion
        constants = expansion.constants(expansion.base.known_rates, self.breaks.weights(expansion.base))
        return expansion.network.with_rates(constants * expansion.scales(self.measured_in, tank))

    def posterior(self, network: Network, tank: Tank | None = None) -> ClassPosterior:
        """What the evidence leaves open of the entries behind the constants of `apply(network, tank)`."""
        self._check(network)
        known = [self.rates.classes[key] for key in self._keys]
        return ClassPosterior(
            self.expansion,
            self.breaks,
            tuple(entry.rate for entry in known),
            tuple(entry.events for entry in known),
            tuple(entry.exposure for entry in known),
            tuple(entry.exposures for entry in known),
            self.expansion.scales(self.measured_in, tank),
            self._keys,
            self._shares,
            tuple(entry.exposure_by_shape for entry in known),
        )

    def expected(self, network: Network, tank: Tank | None = None) -> Network:
        """As `apply`, with the posterior mean of each rate constant."""
        return self.posterior(network, tank).expected

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

    def _check(self, network: Network) -> None:
        if network.fingerprint != self.derivation.network.fingerprint:
            raise ValueError(f"these rates are for the network of book {self.derivation.book.name!r}, not for this one")
