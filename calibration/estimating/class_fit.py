"""Constants by rate class, fitted to the joins or to the breaks of runs of any books.

The propensity of an event is (sum over classes of ways x constant) x (sum over partners of weight x pairs); of joins
the second factor is the pairs themselves. Classes may share a constant: all sizes at a pair of faces, all faces where
as many meet, or all ways of an event. A channel with ways of one class gives it its events; where the ways are of
several, each class takes its expected part (EM: Dempster, Laird & Rubin 1977, J. R. Stat. Soc. B 39, 1), which
converges to the largest likelihood.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from calibration.estimating.class_evidence import ClassEvidence
from calibration.estimating.mixed_evidence import MixedEvidence
from calibration.estimating.named_partners import of_the_named
from calibration.estimating.rate_fit import ImpossibleEventError
from calibration.estimating.shape_posterior import posterior_of
from calibration.estimating.shape_search import least
from kinetics.rates import (
    BreakTerms,
    ClassRate,
    ShapePosterior,
    class_keys,
    general_entries,
    measured_class,
    more_general,
    with_prior,
)
from kinetics.rates.breaks import BreakModel, ShapeParameter
from kinetics.support.arrays import Floats

Grouping = Literal["event", "touched", "faces", "sizes"]
GROUPINGS: tuple[Grouping, ...] = ("event", "touched", "faces", "sizes")  # what classes of one constant have in common
CLOSE = 2.0  # of AIC: within it of the smallest, the fit with the fewest parameters is taken
ROUNDS = 1000  # of EM, at most
EXACT = 1e-9  # of all events: what EM may still move
SEVERAL = 3  # classes, from which on their scatter says something
SCATTERED = 128  # shapes tried at first


class _Shares(NamedTuple):
    """What EM came to. constants : (G,) 1/tu; events : (G,) with channels of several groups shared out"""

    constants: Floats
    events: Floats
    shape: dict[str, float]


@dataclass(frozen=True, eq=False)
class ClassFit:
    """Constants of the classes of one kind of event, by maximum likelihood.

    breaks : the break model; None for joins
    by_partner : whether the likelihood is that of who broke what, where the runs name it
    """

    evidence: ClassEvidence
    grouping: Grouping
    breaks: BreakModel | None = None
    by_partner: bool = False

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """The groups, as keys of a class rates file, of which the runs had the ways."""
        measured = self.evidence.exposure.sum(axis=1) > 0
        keys = [self._key(place) for place in np.flatnonzero(measured).tolist()]
        return tuple(dict.fromkeys(keys))

    def _key(self, place: int) -> str:
        return class_keys(self.evidence.classes[place])[-1 - GROUPINGS.index(self.grouping)]

    @cached_property
    def _groups(self) -> Floats:
        """Which group (K, G) each class belongs to; one without exposure to none."""
        places = {key: g for g, key in enumerate(self.keys)}
        table = np.zeros((len(self.evidence.classes), len(places)))
        for k in range(len(table)):
            if self._key(k) in places:
                table[k, places[self._key(k)]] = 1.0
        return table

    @cached_property
    def exposure(self) -> Floats:
        """Exposure (G, C) of each group to each partner, tu."""
        return self._groups.T @ self.evidence.exposure

    @cached_property
    def _ways(self) -> Floats:
        """Ways (L, G) of each sort of channel by group."""
        return self.evidence.ways @ self._groups

    @cached_property
    def _rows(self) -> Floats:
        known = self.evidence
        if not self.by_partner or known.named is None:
            return known.at_events
        return of_the_named(known.at_events, known.named)

    @cached_property
    def parameters(self) -> tuple[ShapeParameter, ...]:
        """The shape parameters of the break model."""
        return () if self.breaks is None else self.breaks.size_parameters

    def weights(self, shape: Mapping[str, float]) -> Floats:
        """Weights (C,) of the partners."""
        if self.breaks is None:
            return np.ones(1)
        bodies, wall, alone = self.breaks.by_size(self.evidence.sizes, shape)
        return np.append(bodies, [wall, alone])

    @cached_property
    def _found(self) -> _Shares:
        counts = np.bincount(self.evidence.sorts, minlength=len(self._ways)).astype(float)
        shape = {parameter.name: parameter.start for parameter in self.parameters}
        events = self._shared_out(counts, np.ones(len(self.keys)))
        for number in range(ROUNDS):
            before = events
            shape = self._shape(events, shape, scattered=number == 0)
            whole = self.exposure @ self.weights(shape)
            for _ in range(ROUNDS):
                constants = np.divide(events, whole, out=np.zeros(whole.size), where=whole > 0)
                last, events = events, self._shared_out(counts, constants)
                if np.abs(events - last).max(initial=0.0) <= EXACT * counts.sum():
                    break
            if np.abs(events - before).max(initial=0.0) <= EXACT * counts.sum():
                break
        return _Shares(constants, events, shape)

    def _shared_out(self, counts: Floats, constants: Floats) -> Floats:
        """Events (G,) that each group expects of these counts (L,), at these constants."""
        expected = self._ways * constants
        total = expected.sum(axis=1, keepdims=True)
        return counts @ np.divide(expected, total, out=np.zeros_like(expected), where=total > 0)

    def _mixed(self, events: Floats) -> MixedEvidence:
        each, copies = np.unique(self._rows, axis=0, return_counts=True)
        return MixedEvidence(each, copies, self.exposure, events)

    def _shape(self, events: Floats, start: Mapping[str, float], scattered: bool) -> dict[str, float]:
        """The shape of largest likelihood, given the events of each group."""
        if not self.parameters or not self.evidence.sorts.size:
            return dict(start)
        mixed, names = self._mixed(events), [parameter.name for parameter in self.parameters]

        def costs(table: Floats) -> Floats:
            shapes = (dict(zip(names, row, strict=True)) for row in table.tolist())
            return -mixed.highest(np.array([self.weights(shape) for shape in shapes]))

        best = least(self.parameters, [start[name] for name in names], costs, SCATTERED if scattered else 0)
        return dict(zip(names, best, strict=True))

    @property
    def shape(self) -> dict[str, float]:
        """The shape parameters by name."""
        return self._found.shape

    @property
    def constants(self) -> Floats:
        """Constants (G,), 1/tu: of a join per way and pair, of a break per way and partner of weight 1."""
        return self._found.constants

    @cached_property
    def log_likelihood(self) -> float:
        """Natural logarithm of the likelihood of all events, with densities in events per tu."""
        weights = self.weights(self.shape)
        sorts, used = np.unique(self.evidence.sorts, return_counts=True)
        with np.errstate(divide="ignore"):
            by_sort = np.log(self._ways[sorts] @ self.constants) @ used
            value = by_sort + np.log(self._rows @ weights).sum() - self.constants @ (self.exposure @ weights)
        return float(value)

    @property
    def free_parameters(self) -> int:
        """Constants and shape parameters."""
        return len(self.keys) + len(self.parameters)

    @property
    def aic(self) -> float:
        """Akaike's information criterion (1974, doi:10.1109/TAC.1974.1100705); the smaller is the better."""
        return 2 * self.free_parameters - 2 * self.log_likelihood

    @cached_property
    def posterior(self) -> ShapePosterior | None:
        """What the events leave open of the shape, as `shape_posterior` has it for single channels."""
        if not self.evidence.sorts.size:
            return None
        mixed = self._mixed(self._found.events)
        return posterior_of(
            self.parameters, self.shape, lambda shapes: mixed.highest(np.array([self.weights(s) for s in shapes]))
        )

    @property
    def terms(self) -> BreakTerms:
        """The break model as a class rates file states it; ValueError for joins."""
        if self.breaks is None:
            raise ValueError("joins have no break model")
        return BreakTerms(model=self.breaks.name, shape=self.shape, posterior=self.posterior)

    @cached_property
    def entries(self) -> dict[str, ClassRate]:
        """Key -> constant with events, exposure and 95 % interval, then the more general keys.

        Intervals are those of a count in a known exposure (Garwood 1936), given the shape and the way in which events
        of several classes were shared out. The evidence of a more general key is cut down to what the scatter between
        its members leaves of it, so that it covers classes that no run had. Where constants go by sizes, that evidence
        is added to each member's own (empirical Bayes: Efron & Morris 1973, doi:10.1080/01621459.1973.10481350):
        classes are many and their events few, and half an event for each, by Jeffreys' prior, would be too many.
        """
        weights = self.weights(self.shape)
        found: dict[str, ClassRate] = {}
        for key, events, exposure in zip(self.keys, self._found.events.tolist(), self.exposure, strict=True):
            whole = float(exposure @ weights)
            if whole > 0:
                shown = tuple(float(f"{value:.6g}") for value in exposure.tolist())
                parts = {"exposures": shown} if self.parameters else {}
                found[key] = measured_class(events / whole, events, whole, **parts)
        wider = general_entries(found)
        if self.grouping == "sizes":
            known = Counter(other for key in found for other in more_general(key))
            for key, entry in found.items():
                enough = (o for o in more_general(key) if known[o] >= SEVERAL and wider[o].rate > 0)
                prior = next(enough, None)
                found[key] = entry if prior is None else with_prior(entry, wider[prior])
        return found | wider


def simplest(fits: Sequence[ClassFit]) -> ClassFit:
    """The fit with the fewest parameters whose AIC is within 2 of the smallest; of two alike, the smaller AIC.

    ImpossibleEventError: every fit calls something impossible that was seen.
    """
    possible = [fit for fit in fits if np.isfinite(fit.aic)]
    if not possible:
        raise ImpossibleEventError("an event happened that every break model calls impossible; take another one")
    least_aic = min(fit.aic for fit in possible)
    return min((f for f in possible if f.aic <= least_aic + CLOSE), key=lambda fit: (fit.free_parameters, fit.aic))
