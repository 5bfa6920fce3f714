"""Calibration by rate class: how classes share constants and how bonds break, as the runs choose, and the rates."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.break_comparison import too_few
from calibration.estimating.break_rates import BreakRates, BreaksBySize
from calibration.estimating.exposure import require_tanks
from calibration.estimating.grouping import SHARINGS, Grouping, Sharing
from calibration.estimating.likelihood import PathLikelihood
from calibration.estimating.models import MassActionRates
from calibration.estimating.rate_fit import RateFit, can_hold, simplest
from calibration.estimating.shape_posterior import shape_posterior
from kinetics.assembly import Derivation
from kinetics.network import Tank
from kinetics.rates import (
    BreakTerms,
    ClassRate,
    ClassRates,
    general_entries,
    measured_class,
    more_general,
    with_prior,
)
from kinetics.rates.breaks import BREAK_MODELS, BreakModel, break_model
from kinetics.runs import JumpPath

SEVERAL = 3  # classes, from which on their scatter says something
SHARED = {  # how each fit shares its constants
    "event": "one constant",
    "touched": "a constant per number touched",
    "faces": "a constant per pair of faces",
    "sizes": "a constant per class including sizes",
}


class BookRuns(NamedTuple):
    """Runs of one book, as paths of its derived network."""

    derivation: Derivation
    paths: tuple[JumpPath, ...]


@dataclass(frozen=True, eq=False, repr=False)
class ClassFit(RateFit):
    """Constants of the classes of one kind of event. sharing : what the classes of one constant have in common."""

    sharing: Sharing

    @classmethod
    def of(cls, finest: PathLikelihood, sharing: Sharing, model: BreakRates | None = None) -> ClassFit:
        """Fit to the evidence of classes. model : the break model in the place of the likelihood's own."""
        of = finest.model if model is None else model
        likelihood = finest.of(of, finest.grouping.sharing(sharing, measured(finest)))
        # Without events nothing is known of the shape: it stays as it is.
        fixed = {} if likelihood.counts.any() else of.shape_values
        return cls(likelihood, {}, likelihood.maximum(fixed), sharing)

    @property
    def is_held(self) -> bool:
        """Whether the events outnumber the constants that they call for, and the shape."""
        return can_hold(self.best.events, len(self.model.shape))

    @property
    def breaks(self) -> BreakModel | None:
        """The break model; None for joins."""
        return self.model.breaks if isinstance(self.model, BreakRates) else None

    @property
    def title(self) -> str:
        """How the fit shares its constants, for a table."""
        return SHARED[self.sharing] + ("" if self.breaks is None else f", {self.breaks.name}")

    @property
    def terms(self) -> BreakTerms:
        """The break model as a class rates file states it; ValueError for joins."""
        if self.breaks is None:
            raise ValueError("joins have no break model")
        posterior = shape_posterior(self) if self.best.events.any() else None
        return BreakTerms(model=self.breaks.name, shape=self.model.shape_values, posterior=posterior)

    @cached_property
    def entries(self) -> dict[str, ClassRate]:
        """Key -> constant with events, exposure and 95 % interval, then the more general keys.

        Intervals are those of a count in a known exposure (Garwood 1936), given the shape and the way in which events
        of several classes were shared out. The evidence of a more general key is cut down to what the scatter between
        its members leaves of it, so that it covers classes that no run had. If constants go by sizes, that evidence
        is added to each member's own (empirical Bayes: Efron & Morris 1973, doi:10.1080/01621459.1973.10481350):
        classes are many and their events few, and half an event for each, by Jeffreys' prior, would be too many.
        """
        mixture = self.model.mixture()
        weights = np.ones(1) if mixture is None else mixture[0]
        found: dict[str, ClassRate] = {}
        exposures = self.likelihood.exposure(self.model)
        for key, events, exposure in zip(self.channels, self.best.events.tolist(), exposures, strict=True):
            whole = float(exposure @ weights)
            if whole > 0:
                shown = tuple(float(f"{value:.6g}") for value in exposure.tolist())
                parts = {"exposures": shown} if self.model.shape else {}
                found[key] = measured_class(events / whole, events, whole, **parts)
        wider = general_entries(found)
        if self.sharing == "sizes":
            known = Counter(other for key in found for other in more_general(key))
            for key, entry in found.items():
                enough = (o for o in more_general(key) if known[o] >= SEVERAL and wider[o].rate > 0)
                prior = next(enough, None)
                found[key] = entry if prior is None else with_prior(entry, wider[prior])
        return found | wider


@dataclass(frozen=True, eq=False)
class ClassCalibration:
    """Constants of all rate classes, from runs of any books.

    joins, breaks : what the runs say of each, class by class
    models : the break models to choose from, all of them with weights by size
    sharings : what classes may have in common to share a constant, to choose from

    Which classes share a constant, and which break model holds, is decided by AIC: the fewest parameters within 2 of
    the smallest. If a model with partners wins and the runs name the partners, its constants and shape come from the
    likelihood of who broke what.
    """

    joins: PathLikelihood
    breaks: PathLikelihood
    faces: str
    models: tuple[BreakRates, ...]
    sharings: tuple[Sharing, ...] = SHARINGS

    @cached_property
    def join_fits(self) -> tuple[ClassFit, ...]:
        """One for each way of sharing constants; none if nothing joins.

        Where all places touch as many cubes, one constant is that of such places, and says little of others.
        """
        there = np.flatnonzero(measured(self.joins)).tolist()
        touched = {self.joins.grouping.classes[place].touched for place in there}
        if not touched:
            return ()
        left_out = {"event"} if len(touched) == 1 and "touched" in self.sharings else set()
        return tuple(ClassFit.of(self.joins, sharing) for sharing in self.sharings if sharing not in left_out)

    @cached_property
    def break_fits(self) -> tuple[ClassFit, ...]:
        """One for each break model and way of sharing constants that the breaks can hold; none if nothing could break.

        The first one is always there.
        """
        if not measured(self.breaks).any():
            return ()
        alike = {"touched"} if "event" in self.sharings else set()  # at a bond that breaks one face meets one
        sharings = [sharing for sharing in self.sharings if sharing not in alike]
        first, *rest = (ClassFit.of(self.breaks, sharing, model) for model in self.models for sharing in sharings)
        return (first, *(fit for fit in rest if fit.is_held))

    @cached_property
    def chosen_joins(self) -> ClassFit | None:
        """The joins' fit; None if nothing joins."""
        return simplest(self.join_fits) if self.join_fits else None

    @cached_property
    def chosen_breaks(self) -> ClassFit | None:
        """The breaks' fit; None if nothing could break."""
        if not self.break_fits:
            return None
        first = simplest(self.break_fits)
        are_named = all(path.partners is not None for path in self.breaks.paths)
        if not are_named or not first.model.shape:
            return first
        held = dict.fromkeys(fit.model.breaks for fit in self.break_fits if isinstance(fit.model, BreakRates))
        by_partner = [replace(m, by_partner=True) for m in self.models if m.shape and m.breaks in held]
        return simplest([ClassFit.of(self.breaks, first.sharing, model) for model in by_partner])

    @property
    def chosen(self) -> tuple[ClassFit, ...]:
        """The fits of joins and of breaks, as far as there are any."""
        return tuple(fit for fit in (self.chosen_joins, self.chosen_breaks) if fit is not None)

    @property
    def not_measured(self) -> tuple[str, ...]:
        """Classes of which no run had the ways: a more general key must stand for them."""
        return tuple(
            key
            for known in (self.joins, self.breaks)
            for key, there in zip(known.grouping.keys, measured(known), strict=True)
            if not there
        )

    def rates(self, evidence: Mapping[str, Any] | None = None) -> ClassRates:
        """The chosen fits as a class rates file; `evidence` says where they come from.

        ValueError: the runs had nothing that could join or break.
        """
        if not self.chosen:
            raise ValueError("no run could join or break anything; add runs with more cubes, or longer ones")
        tank = self.joins.paths[0].tank
        breaks = BreakTerms() if self.chosen_breaks is None else self.chosen_breaks.terms
        return ClassRates(
            faces=self.faces,
            tank=None if tank is None else tank.size,
            breaks=breaks,
            classes={key: entry for fit in self.chosen for key, entry in fit.entries.items()},
            evidence=dict(evidence or {}) | {"fits": self.reasons},
        )

    @property
    def reasons(self) -> dict[str, str]:
        """A sentence on how constants are shared and how bonds break, with the next best choice."""
        found = {}
        for fits, chosen in self._compared:
            others = sorted((fit for fit in fits if fit.title != chosen.title), key=lambda fit: fit.aic)
            reason = chosen.title
            if others:
                (own,) = (fit for fit in fits if fit.title == chosen.title)
                reason += f"; AIC {others[0].aic - own.aic:+.1f} for {others[0].title}"
            found["joins" if chosen.breaks is None else "breaks"] = reason
        if self.about_breaks:
            found["breaks"] += f"; {self.about_breaks}"
        return found

    @property
    def about_breaks(self) -> str:
        """What too few breaks leave open; "" if some were seen and several models compared, or one asked for."""
        seen, compared = int(self.breaks.counts.sum()), {fit.breaks for fit in self.break_fits}
        is_open = not seen or len(compared) < min(2, len(self.models))
        return too_few(seen) if self.break_fits and is_open else ""

    @property
    def _compared(self) -> list[tuple[tuple[ClassFit, ...], ClassFit]]:
        """The fits of joins, and of breaks, with the one that was chosen."""
        both = ((self.join_fits, self.chosen_joins), (self.break_fits, self.chosen_breaks))
        return [(fits, chosen) for fits, chosen in both if chosen is not None]

    def fits_table(self) -> list[dict[str, Any]]:
        """One row a fit that was compared: kind, how constants are shared, break model, parameters, AIC above least.

        A kind of event with a single fit has no row: nothing was compared.
        """
        return [
            {
                "event": "join" if fit.breaks is None else "break",
                "same": fit.sharing,
                "breaks": None if fit.breaks is None else fit.breaks.name,
                "free_parameters": fit.free_parameters,
                "aic_above_least": fit.aic - min(each.aic for each in fits),
                "is_chosen": fit.title == chosen.title,
            }
            for fits, chosen in self._compared
            if len(fits) > 1
            for fit in fits
        ]

    def table(self) -> list[dict[str, Any]]:
        """One row a key: events, exposure (tu), rate and 95 % limits (1/tu)."""
        return [
            {"class": key, **entry.as_dict(without={"exposure_by_shape", "exposures"})}
            for fit in self.chosen
            for key, entry in fit.entries.items()
        ]


def measured(likelihood: PathLikelihood) -> NDArray[np.bool_]:
    """Constants (K,) of whose ways the runs had any."""
    return np.asarray(likelihood.exposure(likelihood.model).sum(axis=1) > 0)


def calibrate_classes(books: Iterable[BookRuns], breaks: str = "auto", share: str = "auto") -> ClassCalibration:
    """Estimate the constants of all rate classes from runs of any books, seeded or not, in the tank of the first run.

    A class has one constant in every book, so that its events add up over all channels of all books that have ways of
    it, and so do their exposures. Breaks are kept partner by partner, by the partner's size: sizes mean the same in any
    book. Meetings are scaled to the tank of the first run by volume, and hits on walls by surface over volume.

    breaks : name of a break model, or `auto` for the one that the runs choose
    share : what the classes of one constant have in common (`event`, `touched`, `faces` or `sizes`), or `auto`

    Cost: one pass over the paths, then a second or so for the shape.
    ValueError: no runs, face schemes that differ, paths of another network, or tanks of which only some are known; a
    break model whose weights are not given by sizes; another `share`.
    """
    sharings = tuple(sharing for sharing in SHARINGS if share in ("auto", sharing))
    if not sharings:
        raise ValueError(f"share = {share!r}; expected auto, {', '.join(SHARINGS)}")
    groups = [BookRuns(derivation, tuple(paths)) for derivation, paths in books]
    runs = tuple(path for group in groups for path in group.paths)
    if not runs:
        raise ValueError("no runs to estimate from; give at least one path")
    derivations = [group.derivation for group in groups]
    schemes = {derivation.book.scheme for derivation in derivations}
    if len(schemes) > 1:
        raise ValueError(f"books with the faces {', '.join(sorted(schemes))}: their face types mean different things")
    require_tanks(runs)
    for derivation, paths in groups:
        if any(path.network.fingerprint != derivation.network.fingerprint for path in paths):
            raise ValueError(f"a path is not of the network of book {derivation.book.name!r}")
    tank = runs[0].tank
    largest = max(len(s) for derivation in derivations for s in derivation.structures.values())
    models = _asked(breaks, largest, tank)
    joins = PathLikelihood(MassActionRates(tank), runs, Grouping.by_class(derivations, "join"))
    broken = PathLikelihood(models[0], runs, Grouping.by_class(derivations, "break"))
    return ClassCalibration(joins, broken, derivations[0].book.scheme, models, sharings)


def _asked(name: str, largest: int, tank: Tank | None) -> tuple[BreakRates, ...]:
    """The break models to choose from; ValueError if one that is asked for does not weight partners by size."""
    if name != "auto":
        return (BreaksBySize.of(break_model(name), largest, tank),)
    found = []
    for model in BREAK_MODELS:
        with contextlib.suppress(ValueError):
            found.append(BreaksBySize.of(model, largest, tank))
    return tuple(found)
