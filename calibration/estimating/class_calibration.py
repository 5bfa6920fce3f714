"""Calibration by rate class: how classes share constants and how bonds break, as the runs choose, and the rates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from calibration.estimating.class_evidence import BookRuns, ClassEvidence, class_evidence
from calibration.estimating.class_fit import GROUPINGS, ClassFit, Grouping, simplest
from kinetics.rates import BreakTerms, ClassRates
from kinetics.rates.breaks import BREAK_MODELS, BreakModel, break_model


@dataclass(frozen=True, eq=False)
class ClassCalibration:
    """Constants of all rate classes, from runs of any books.

    joins, breaks : the evidence of each
    models : the break models to choose from, all of them with weights by size
    groupings : what classes may have in common to share a constant, to choose from

    Which classes share a constant, and which break model holds, is decided by AIC: the fewest parameters within 2 of
    the smallest. Where a model with partners wins and the runs name the partners, its constants and shape come from the
    likelihood of who broke what.
    """

    joins: ClassEvidence
    breaks: ClassEvidence
    faces: str
    models: tuple[BreakModel, ...]
    groupings: tuple[Grouping, ...] = GROUPINGS

    @cached_property
    def join_fits(self) -> tuple[ClassFit, ...]:
        """One a grouping; none where nothing joins.

        Where all places touch as many cubes, one constant is that of such places, and says little of others.
        """
        touched = {self.joins.classes[place].touched for place in np.flatnonzero(self.joins.exposure[:, 0]).tolist()}
        if not touched:
            return ()
        left_out = {"event"} if len(touched) == 1 and "touched" in self.groupings else set()
        return tuple(ClassFit(self.joins, grouping) for grouping in self.groupings if grouping not in left_out)

    @cached_property
    def break_fits(self) -> tuple[ClassFit, ...]:
        """One a break model and grouping; none where nothing could break."""
        if not self.breaks.exposure.any():
            return ()
        alike = {"touched"} if "event" in self.groupings else set()  # at a bond that breaks one face meets one
        groupings = [grouping for grouping in self.groupings if grouping not in alike]
        return tuple(ClassFit(self.breaks, grouping, model) for model in self.models for grouping in groupings)

    @cached_property
    def chosen_joins(self) -> ClassFit | None:
        """The joins' fit; None where nothing joins."""
        return simplest(self.join_fits) if self.join_fits else None

    @cached_property
    def chosen_breaks(self) -> ClassFit | None:
        """The breaks' fit; None where nothing could break."""
        if not self.break_fits:
            return None
        first = simplest(self.break_fits)
        if self.breaks.named is None or first.breaks is None or not _has_partners(first.breaks):
            return first
        among = [model for model in self.models if _has_partners(model)]
        return simplest([ClassFit(self.breaks, first.grouping, model, by_partner=True) for model in among])

    @property
    def not_measured(self) -> tuple[str, ...]:
        """Classes of which no run had the ways: a more general key must stand for them."""
        return tuple(
            str(rate_class)
            for known in (self.joins, self.breaks)
            for rate_class, exposure in zip(known.classes, known.exposure.sum(axis=1), strict=True)
            if not exposure > 0
        )

    def rates(self, evidence: Mapping[str, Any] | None = None) -> ClassRates:
        """The chosen fits as a class rates file; `evidence` says where they come from.

        ValueError: the runs had nothing that could join or break.
        """
        fits = [fit for fit in (self.chosen_joins, self.chosen_breaks) if fit is not None]
        if not fits:
            raise ValueError("no run could join or break anything; add runs with more cubes, or longer ones")
        tank = self.joins.tank
        breaks = BreakTerms() if self.chosen_breaks is None else self.chosen_breaks.terms
        return ClassRates(
            faces=self.faces,
            tank=None if tank is None else tank.size,
            breaks=breaks,
            classes={key: entry for fit in fits for key, entry in fit.entries.items()},
            evidence=dict(evidence or {}) | {"fits": self.reasons},
        )

    @property
    def reasons(self) -> dict[str, str]:
        """How constants are shared and bonds break, with the next best, in words."""
        found = {}
        for kind, fits, chosen in (
            ("joins", self.join_fits, self.chosen_joins),
            ("breaks", self.break_fits, self.chosen_breaks),
        ):
            if chosen is not None:
                others = sorted((f for f in fits if _title(f) != _title(chosen)), key=lambda fit: fit.aic)
                found[kind] = _title(chosen)
                if others:
                    (own,) = (fit for fit in fits if _title(fit) == _title(chosen))
                    found[kind] += f"; AIC {others[0].aic - own.aic:+.1f} for {_title(others[0])}"
        return found

    def fits_table(self) -> list[dict[str, Any]]:
        """One row a fit that was compared: kind, how constants are shared, break model, parameters, AIC above least."""
        rows = []
        for fits, chosen in ((self.join_fits, self.chosen_joins), (self.break_fits, self.chosen_breaks)):
            lowest = min((fit.aic for fit in fits), default=0.0)
            rows += [
                {
                    "event": fit.evidence.event,
                    "same": fit.grouping,
                    "breaks": None if fit.breaks is None else fit.breaks.name,
                    "free_parameters": fit.free_parameters,
                    "aic_above_least": fit.aic - lowest,
                    "is_chosen": chosen is not None and _title(fit) == _title(chosen),
                }
                for fit in fits
            ]
        return rows

    def table(self) -> list[dict[str, Any]]:
        """One row a key: events, exposure (tu), rate and 95 % limits (1/tu)."""
        return [
            {"class": key, **entry.as_dict(without={"exposure_by_shape", "exposures"})}
            for fit in (self.chosen_joins, self.chosen_breaks)
            if fit is not None
            for key, entry in fit.entries.items()
        ]


def _has_partners(model: BreakModel) -> bool:
    """Whether bodies or walls break a structure."""
    return bool(model.size_parameters)


def _title(fit: ClassFit) -> str:
    """What sets a fit apart, in words."""
    words = {
        "event": "one constant",
        "touched": "a constant a number touched",
        "faces": "a constant a pair of faces",
        "sizes": "a constant a class with sizes",
    }
    return words[fit.grouping] + ("" if fit.breaks is None else f", {fit.breaks.name}")


def calibrate_classes(books: Iterable[BookRuns], breaks: str = "auto", share: str = "auto") -> ClassCalibration:
    """Estimate the constants of all rate classes from runs of any books, seeded or not.

    breaks : name of a break model, or `auto` for the one that the runs choose
    share : what the classes of one constant have in common (`event`, `touched`, `faces` or `sizes`), or `auto`

    Cost: one pass over the paths, then a second or so for the shape.
    ValueError: as `class_evidence`; a break model whose weights are not given by sizes; another `share`.
    """
    groupings = tuple(grouping for grouping in GROUPINGS if share in ("auto", grouping))
    if not groupings:
        raise ValueError(f"share = {share!r}; expected auto, {', '.join(GROUPINGS)}")
    groups = [BookRuns(derivation, tuple(paths)) for derivation, paths in books]
    joins, broken = class_evidence(groups)
    return ClassCalibration(joins, broken, groups[0].derivation.book.scheme, _asked(breaks), groupings)


def _asked(name: str) -> tuple[BreakModel, ...]:
    if name != "auto":
        return (_by_size(break_model(name)),)
    return tuple(model for model in BREAK_MODELS if _is_by_size(model))


def _is_by_size(model: BreakModel) -> bool:
    try:
        _by_size(model)
    except ValueError:
        return False
    return True


def _by_size(model: BreakModel) -> BreakModel:
    """The model; ValueError where its weights are not given by sizes."""
    model.by_size(np.ones(1), {parameter.name: parameter.start for parameter in model.size_parameters})
    return model


__all__: Sequence[str] = ("BookRuns", "ClassCalibration", "calibrate_classes")
