"""The pyramid whose bonds break: what is lost can be rebuilt, and the page says what runs and comparison hold."""

from dataclasses import replace

import pytest
from derived_books import derived

from calibration.estimating.class_calibration import BookRuns, calibrate_classes
from calibration.estimating.class_spread import class_spreads, flagged
from kinetics.assembly import RuleBook, check
from kinetics.assembly.checking.examined import Examined
from kinetics.assembly.checking.home import lost_cubes
from kinetics.assembly.deriving.explore import explore
from kinetics.rates import ClassRates
from tests.results import pyramid_page as page

BREAKING = RuleBook.load("pyramid45_breaking")


def lost(book):
    """Cubes of settled structures that no chain of events leads into a target."""
    found = explore(book)
    return len(lost_cubes(found, Examined(found).targets))


def test_what_is_lost_can_be_rebuilt():
    """Every cube of every structure can come home. The control: where a seed does not wait for its arm again, some not.

    `rules check`, behind --validate below, finds no fault at all.
    """
    assert lost(BREAKING) == 0
    forgetful = replace(BREAKING, dissociate=tuple(rule for rule in BREAKING.dissociate if rule.rule != "arm lost"))
    assert lost(forgetful) > 0


@pytest.mark.validate
def test_the_book_has_no_fault():
    report = check(BREAKING)
    assert not report.findings
    assert report.home.proven == "enough free cubes"
    assert report.home.searched == (45,)


def test_all_held_out_runs_are_there():
    runs = page.records(page.PLAN.held_out)
    assert [run.outcome for run in runs] == ["completed"] * 4
    assert page.compared()["runs"] == 4


def test_the_page_says_what_the_files_say():
    text = page.PAGE.read_text(encoding="utf-8")
    assert page.filled(text) == text
    (block,) = page.BLOCK.findall(text)
    other = text.replace("| joins | 201 |", "| joins | 202 |")
    assert other != text
    assert page.filled(other) == text  # the control
    assert block


def test_places_that_touch_two_cubes_are_filled_more_slowly():
    """The reason: the jacks' constant holds beside one cube; beside two its limits and the jacks' lie apart."""
    one, two = page.contacts(page.records(page.PLAN.held_out))
    jacks = ClassRates.load(page.ROOT / "results" / "jack13" / "classes.toml").classes["join touching 1"]
    assert (one.touched, two.touched) == (1, 2)
    assert one.limits[0] < jacks.rate < one.limits[1]
    assert two.limits[1] < jacks.low
    # which the test of constants finds in these runs
    books = [BookRuns(derived("pyramid45_breaking"), tuple(run.path for run in page.records(page.PLAN.held_out)))]
    found = flagged(class_spreads(books, calibrate_classes(books, "first-order", "event")))
    assert ("join", "cubes touched") in {(each.key, each.by) for each in found}
