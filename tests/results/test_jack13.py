"""The study of results/jack13: its book is proven, and the stored runs give the stored class rates and events."""

import json
from pathlib import Path

import pytest

from calibration.pipeline.class_study import run_class_calibration
from calibration.pipeline.plan import StudyPlan
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
    specs = PLAN.specs(PLAN.calibration)
    study = run_class_calibration(specs, {}, FOLDER / "runs", progress=False)
    stored = ClassRates.load(FOLDER / "classes.toml")
    assert stored.evidence["plans"]["jack13"] == PLAN.fingerprint
    assert set(study.rates.classes) == set(stored.classes)
    for key, entry in stored.classes.items():
        assert study.rates.classes[key].rate == pytest.approx(entry.rate, rel=1e-3)
    assert study.rates.breaks.model == stored.breaks.model == "collision-wall"


def test_the_page_has_the_figures_of_the_validation():
    (done,) = json.loads((FOLDER / "validation.json").read_text(encoding="utf-8"))["comparisons"]
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert done["is_consistent"]
    for row in done["events"]:
        assert (
            f"| {row['kind']} | {row['seen']} | {row['expected']:.0f} ({row['low']:.0f} to {row['high']:.0f})" in page
        )
    largest = done["curves"]["largest"]
    assert f"| {largest['observed'][-1]:.1f} | {largest['predicted'][-1]:.1f} (" in page
