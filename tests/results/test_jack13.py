"""The study of results/jack13: its book is proven, and the stored runs give the stored class rates and events."""

import json
from pathlib import Path

import pytest

from calibration.estimating.class_spread import flagged
from calibration.pipeline.calibration_study import run_class_calibration
from calibration.pipeline.plan import StudyPlan
from calibration.pipeline.study_runs import StudyRuns
from kinetics.assembly import RuleBook, check
from kinetics.rates import ClassRates
from mechsim.runs.shards import missing

FOLDER = Path(__file__).parents[2] / "results" / "jack13"
PLAN = StudyPlan.load(FOLDER / "plan.toml")


def test_what_is_lost_can_be_rebuilt():
    assert not check(RuleBook.load("jack13")).findings


def test_all_runs_are_there():
    assert not missing(PLAN.specs(PLAN.calibration) + PLAN.specs(PLAN.held_out), FOLDER / "runs")


def test_the_runs_give_the_rates():
    study = run_class_calibration([StudyRuns.planned(PLAN, "calibration")], FOLDER / "runs", progress=False)
    stored = ClassRates.load(FOLDER / "classes.toml")
    assert stored.evidence["plans"]["jack13"] == PLAN.fingerprint
    assert set(study.rates.classes) == set(stored.classes)
    for key, entry in stored.classes.items():
        assert study.rates.classes[key].rate == pytest.approx(entry.rate, rel=1e-3)
    assert study.rates.breaks.model == stored.breaks.model


def test_the_control_has_one_constant_for_all_breaks():
    runs = StudyRuns.planned(PLAN, "calibration")
    study = run_class_calibration([runs], FOLDER / "runs", breaks="first-order", share="event", progress=False)
    stored = ClassRates.load(FOLDER / "control.toml")
    assert set(stored.classes) == {"join", "break"}
    assert stored.breaks.model == "first-order"
    for key, entry in stored.classes.items():
        assert study.rates.classes[key].rate == pytest.approx(entry.rate, rel=1e-3)
    assert "break" in {spread.key for spread in flagged(study.spreads)}  # it pools what differs
    page = " ".join((FOLDER / "README.md").read_text(encoding="utf-8").split())
    assert f"({stored.classes['break'].events:.0f} events in {stored.classes['break'].exposure:,.0f} tu)" in page


def test_the_page_has_the_figures_of_the_validation():
    (done,) = json.loads((FOLDER / "validation.json").read_text(encoding="utf-8"))["comparisons"]
    page = " ".join((FOLDER / "README.md").read_text(encoding="utf-8").split())
    assert done["is_consistent"]
    for row in done["events"]:
        assert (
            f"| {row['kind']} | {row['seen']} | {row['expected']:.0f} ({row['low']:.0f} to {row['high']:.0f})" in page
        )
    (control,) = json.loads((FOLDER / "control.json").read_text(encoding="utf-8"))["comparisons"]
    assert not control["is_consistent"]  # one constant for all breaks is refuted by the same runs
    small = control["curves"]["2 to 3 cubes"]
    middle, low, high = (small[key][-1] for key in ("predicted", "low", "high"))
    assert f"{small['observed'][-1]:.1f} where {middle:.1f} ({low:.1f} to {high:.1f}) are predicted" in page
    p_misfit = f"{small['p_misfit']:.4f}".lstrip("0")
    assert f"{small['coverage']:.0%}".replace("%", " %") + " of the times inside the band" in page
    assert f"misfit {small['misfit']:.1f}, p {p_misfit}, where" in page
    assert control["groups"] == 1999
    shown = [f"{power['in_row']:.2f}".lstrip("0") for power in done["powers"]]
    assert f"in their row with probability {shown[0]}, and breaks 20 % off with {shown[1]}." in page
    assert not done["cannot_fail"]
    largest = done["curves"]["largest"]
    assert f"| {largest['observed'][-1]:.1f} | {largest['predicted'][-1]:.1f} (" in page
