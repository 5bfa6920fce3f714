"""What runs say of rates, ready to be saved and shown: channel by channel, or by rate class over several books."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from calibration.estimating.break_comparison import BreakComparison, rates_with_breaks, too_few
from calibration.estimating.class_calibration import BookRuns, ClassCalibration, calibrate_classes
from calibration.estimating.class_spread import ClassSpread, class_spreads
from calibration.estimating.crowding_comparison import CrowdingComparison, crowding_terms
from calibration.estimating.diagnosing.diagnosis import Diagnosis, diagnose
from calibration.estimating.estimate import Calibration, estimate
from calibration.estimating.exposure import Crowd
from calibration.estimating.hits import RunHits
from calibration.estimating.joins_and_breaks import BREAKS, joins_and_breaks
from kinetics.rates import ClassRates, CrowdingTerms, Rates
from kinetics.rates.crowding import ConvexBodies
from kinetics.runs import JumpPath
from kinetics.support.arrays import Ints


@dataclass(frozen=True, eq=False)
class CalibrationStudy:
    """Runs of one network, whoever made them, and the rates of its channels that they give.

    name : of the scene, rule book or network file
    paths : the runs
    evidence : what a rates file says of them
    source, made : descriptions of where the rates come from and of how the runs were made
    breaks : name of a break model, or `auto` for the one that the runs choose; None: breaks as they were counted
    within : tu, longest time between the two breaks of one collision; None if the runs do not resolve it
    bonds : per run (E, 2), the two cubes of each event; None where they are not known
    crowding : name of a model of crowding, or `auto` for the one that logged hits choose
    hits, bodies : the runs' logs of hits, and the geometry of all species; none where they are not known
    problems : a message for each run that was left out
    """

    name: str
    paths: Sequence[JumpPath]
    evidence: dict[str, Any]
    source: str
    made: str
    breaks: str | None = None
    within: float | None = None
    bonds: Sequence[Ints] | None = None
    crowding: str = "none"
    hits: Sequence[RunHits] = ()
    bodies: ConvexBodies | None = None
    problems: Sequence[str] = ()

    @cached_property
    def calibration(self) -> Calibration:
        """Pooled events and exposures of all channels."""
        return estimate(self.paths, self._crowd)

    @cached_property
    def crowding_models(self) -> CrowdingComparison | None:
        """Models of crowding fitted to logged hits; None if none was asked for, or no hits were logged."""
        if self.crowding == "none" or not self.hits or self.bodies is None:
            return None
        return CrowdingComparison.of(self.hits, self.bodies)

    @cached_property
    def crowding_terms(self) -> CrowdingTerms | None:
        """The crowding under which all rates are measured; None for mass action.

        ValueError: a model that logged hits must fit, or one of hard bodies whose geometry is not known.
        """
        if self.crowding == "none":
            return None
        return crowding_terms(self.crowding, self.crowding_models, self.bodies, self.paths[0].network.species)

    @property
    def _crowd(self) -> Crowd | None:
        return None if self.crowding_terms is None else self.crowding_terms.crowding

    @cached_property
    def break_models(self) -> BreakComparison | None:
        """Break models fitted to the runs; None if none was asked for, or nothing breaks."""
        return (
            None
            if self.breaks is None
            else BreakComparison.asked_for(self.breaks, self.paths, self.within, self._crowd)
        )

    @cached_property
    def shown_breaks(self) -> BreakComparison | None:
        """The break models to be shown side by side; None without a single break, of which all say the same."""
        return self.break_models if self.counts.get(BREAKS) else None

    @property
    def counts(self) -> dict[str, int]:
        """Runs, and events in all of them: joins and breaks where the network has such channels, then others."""
        events, groups = self.calibration.total.events, joins_and_breaks(self.calibration.network)
        wholes = {name: int(events[members].sum()) for name, members in groups.items()}
        others, named = int(events.sum()) - sum(wholes.values()), "other events" if wholes else "events"
        return {"runs": len(self.paths), **wholes, **({named: others} if others else {})}

    @property
    def about_breaks(self) -> str:
        """What too few breaks leave open; "" where models were compared, or none was asked for, or nothing breaks."""
        if self.breaks is None or BREAKS not in self.counts or self.shown_breaks is not None:
            return ""
        model = "first-order" if self.break_models is None else self.break_models.chosen.model.name
        return f"breaks are taken as {model}; {too_few(self.counts[BREAKS])}"

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Are the runs those of a well-mixed Markov chain, whose bonds break as the chosen model says?"""
        return diagnose(self.paths, None if self.break_models is None else self.break_models.chosen, self.bonds)

    @cached_property
    def rates(self) -> Rates:
        """The estimates with their evidence, ready to be saved; see `Calibration.rates` for what was not measured."""
        looks = self.diagnosis.looks
        evidence = {
            **self.evidence,
            "doubtful_tests": self.diagnosis.doubtful,
            **({"coarse_looks": looks.sentence} if looks.channels else {}),
            **({"break_model": self.about_breaks} if self.about_breaks else {}),
            **({} if self.crowding_models is None else {"crowding": self.crowding_models.reason}),
        }
        return rates_with_breaks(self.calibration, self.break_models, evidence, self.crowding_terms)

    def to_dict(self) -> dict[str, Any]:
        """Rates, break models, diagnostics and evidence, ready for JSON."""
        looks = self.diagnosis.looks
        return {
            "channels": self.calibration.table(),
            "coarse_looks": {"sentence": looks.sentence, "channels": looks.table()} if looks.channels else None,
            "not_seen": self.calibration.not_seen,
            "not_measured": self.rates.not_measured,
            "breaks": None if self.shown_breaks is None else self.shown_breaks.to_dict(),
            "crowding": None if self.crowding_models is None else self.crowding_models.to_dict(),
            "evidence": self.rates.evidence,
            "diagnostics": self.diagnosis.to_dict(),
            "problems": self.problems,
        }


@dataclass(frozen=True, eq=False)
class ClassStudy:
    """Runs of one or several books and the class rates that they give.

    breaks : name of a break model, or `auto` for the one that the runs choose
    share : what the classes of one constant have in common, or `auto`
    """

    books: Sequence[BookRuns]
    evidence: dict[str, Any]
    source: str
    breaks: str = "auto"
    share: str = "auto"
    problems: Sequence[str] = ()

    @cached_property
    def calibration(self) -> ClassCalibration:
        """Pooled over all books."""
        return calibrate_classes(self.books, self.breaks, self.share)

    @cached_property
    def spreads(self) -> tuple[ClassSpread, ...]:
        """The tests of each constant: does it fit all the channels pooled in it?"""
        return class_spreads(self.books, self.calibration)

    @cached_property
    def rates(self) -> ClassRates:
        """The class rates with their evidence, ready to be saved."""
        return self.calibration.rates(self.evidence)

    def to_dict(self) -> dict[str, Any]:
        """Rates, the fits that were compared, spreads and evidence, ready for JSON."""
        return {
            "classes": self.calibration.table(),
            "not_measured": self.calibration.not_measured,
            "fits": self.calibration.fits_table(),
            "spreads": [spread.to_dict() for spread in self.spreads],
            "breaks": {"model": self.rates.breaks.model, "shape": self.rates.breaks.shape},
            "evidence": self.rates.evidence,
            "problems": self.problems,
        }
