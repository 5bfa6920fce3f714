"""The pyramid whose bonds break: what is lost can be rebuilt, and the page says what runs and comparison hold."""

import json
from dataclasses import replace

import pytest

from calibration.estimating.class_calibration import BookRuns, calibrate_classes
from calibration.estimating.class_spread import class_spreads, flagged
from calibration.pipeline.plan import StudyPlan
from kinetics.assembly import RuleBook, check
from kinetics.assembly.checking.exploration_index import ExplorationIndex
from kinetics.assembly.checking.recoverability import lost_cubes
from kinetics.assembly.deriving.explore import explore
from kinetics.rates import ClassRates
from mechsim.runs.store import RunStore
from tests.helpers.derived_books import derived, explored
from tests.results import pyramid_page as page

BREAKING = RuleBook.load("pyramid45_breaking")


def lost(found):
    """Cubes of settled structures that no chain of events leads into a target."""
    return len(lost_cubes(found, ExplorationIndex(found).targets))


@pytest.mark.validate
def test_what_is_lost_can_be_rebuilt():
    """Every cube of every structure can end in the target. Control: if seeds do not wait for their arms, some cannot.

    `rules check`, behind --validate below, finds no fault at all.
    """
    assert lost(explored("pyramid45_breaking")) == 0
    forgetful = replace(BREAKING, dissociate=tuple(rule for rule in BREAKING.dissociate if rule.rule != "arm lost"))
    assert lost(explore(forgetful)) > 0


@pytest.mark.validate
def test_the_book_has_no_fault():
    report = check(BREAKING)
    assert not report.findings
    assert report.recoverability.proven == "enough free cubes"
    assert report.recoverability.searched == (45,)


def test_all_runs_are_there():
    for part, number in ((page.FIRST.held_out, 4), (page.PLAN.held_out, 8), (page.PLAN.calibration, 8)):
        assert [run.outcome for run in page.records(part)] == ["completed"] * number
    assert {page.compared(name)["runs"] for name in page.COMPARED} == {8}
    seen = {json.dumps([e["seen"] for e in page.compared(name)["events"]]) for name in page.COMPARED}
    assert len(seen) == 1  # of the same runs


def test_the_page_says_what_the_files_say():
    text = page.PAGE.read_text(encoding="utf-8")
    assert page.filled(text) == text
    (block,) = page.BLOCK.findall(text)
    other = text.replace("| joins | 429 |", "| joins | 430 |")
    assert other != text
    assert page.filled(other) == text  # the control
    assert block
    power = page.compared("growth")["powers"][0]
    told = f"joins 20 % off in their row with probability {power['in_row']:.2f}".replace("0.", ".")
    assert told in " ".join(text.split())


def test_growth_is_as_predicted_where_classes_know_places():
    """The judge passes; of the control, which knows no places, two curves are beyond all its predicted groups."""
    judge, control = page.compared("growth"), page.compared("control")
    assert judge["is_consistent"]
    assert not judge["cannot_fail"]
    for curve in ("2 to 3 cubes", "8 to 15 cubes"):
        assert control["curves"][curve]["p_misfit"] == pytest.approx(1 / (control["groups"] + 1))
        assert judge["curves"][curve]["misfit"] < 2
        assert control["curves"][curve]["misfit"] > 6


def test_places_that_touch_two_cubes_are_filled_more_slowly():
    """The stored rates are those of the runs, jacks and pyramids together, and no test of constants flags them.

    The control, one constant for all joins, is flagged by cubes touched.
    """
    jacks = StudyPlan.load(page.ROOT / "results" / "jack13" / "plan.toml")
    stored = RunStore(page.ROOT / "results" / "jack13" / "runs").existing(jacks.specs(jacks.calibration))
    books = [
        BookRuns(derived("jack13"), tuple(run.path for run in stored)),
        BookRuns(derived("pyramid45_breaking"), tuple(run.path for run in page.records(page.PLAN.calibration))),
    ]
    made = calibrate_classes(books)
    known = ClassRates.load(page.FOLDER / "classes.toml").classes
    assert made.chosen_joins.sharing == "touched"
    for key in ("join touching 1", "join touching 2"):
        assert made.chosen_joins.entries[key].rate == pytest.approx(known[key].rate, rel=1e-3)
    assert known["join touching 2"].high < 0.6 * known["join touching 1"].low
    assert not flagged(class_spreads(books, made))
    control = calibrate_classes(books, "first-order", "event")
    stored_control = ClassRates.load(page.FOLDER / "control.toml").classes["join"]
    assert control.chosen_joins.entries["join"].rate == pytest.approx(stored_control.rate, rel=1e-3)
    assert ("join", "cubes touched") in {(each.key, each.by) for each in flagged(class_spreads(books, control))}
