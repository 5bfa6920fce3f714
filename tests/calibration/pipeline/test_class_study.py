"""The loop by class through the commands: stored runs of known class rates, their calibration, held-out growth."""

from dataclasses import replace

import numpy as np
import pytest
from derived_books import derived
from grown_paths import path_of

from calibration.pipeline.held_out_study import run_growth_validation
from calibration.pipeline.plan import PlannedRuns, StudyPlan, Tanks
from calibration.pipeline.study_runs import StudyRuns
from kinetics.networkfree import grow
from kinetics.rates import ClassRates
from kinetics.runs import BY_UNKNOWN, NO_BREAK
from mechsim.runs.record import RunRecord
from mechsim.runs.store import RunStore

JACK = derived("jack13")
START = {"monomer": 20, "seed": 1}
TRUTH = ClassRates(
    faces="two",
    classes={
        "join f1 + f1 touching 1": {"rate": 6e-4},
        "join f1 + f2 touching 1": {"rate": 2e-4},
        "break": {"rate": 4e-3},
    },
)
SCENE = """
name = "jacks"
rules = "jack13"
units = { length = "paper", time = "tu", density = "fluid" }
tank = { size = [2.0, 2.0, 2.0] }
cubes = { edge = 0.15, density = 1.0 }
numerics = { step = 0.01, solver_iterations = 50 }

[[effects]]
effect = "agitation"
sigma = 4.0
hold = 0.02

[[effects]]
effect = "drag"
coefficient = 1.05
points = "sub-cubes"

[[effects]]
effect = "walls"

[[effects]]
effect = "contact"
restitution = 0.3
friction = 0.3

[[effects]]
effect = "breaking"
threshold = 0.01

[[effects]]
effect = "bonding"
capture_distance = 0.02
capture_angle = 135.0
latch = { kind = "encounter", probability = 0.1 }
"""


def stored(specs, folder, rates=TRUTH):
    """Network-free runs under known rates, in the place of mechanics runs."""
    store = RunStore(folder)
    for spec in specs:
        start = {JACK.structures[name]: n for name, n in spec.composition.items()}
        (run,) = grow(JACK.book, rates, start, spec.duration, 1, 1000 * spec.seed + spec.run).runs
        path = path_of(run, JACK)
        is_break = np.array([len(event.before) == 1 for event in JACK.events])[path.channels]
        arrays = {
            "initial": path.initial,
            "times": path.times,
            "channels": path.channels,
            "bonds": np.zeros((path.times.size, 2), np.int16),
            "partners": np.where(is_break, BY_UNKNOWN, NO_BREAK).astype(np.int16),
        }
        facts = {
            "end": spec.duration,
            "steps": 1,
            "species": list(JACK.network.species),
            "channels": list(JACK.network.channels),
            "open_channels": [True] * len(JACK.network.channels),
        }
        store.write(RunRecord(spec, "completed", arrays, facts, {"cpu_seconds": 1.0, "wall_seconds": 1.0}))


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("classes")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    plan = StudyPlan(
        name="jacks",
        scene=str(folder / "scene.toml"),
        calibration=PlannedRuns(seed=5, tanks=[Tanks(composition=START, runs=20, duration=100.0)]),
        held_out=PlannedRuns(seed=6, tanks=[Tanks(composition=START, runs=3, duration=100.0)]),
    )
    plan.save(folder / "plan.toml")
    stored(plan.specs(plan.calibration) + plan.specs(plan.held_out), folder / "runs")
    return folder


@pytest.fixture(scope="module")
def calibrated(wellmixed_here, place):
    return wellmixed_here("calibrate", "plan.toml", "--out", "classes.toml", "--json", cwd=place).json


def test_a_seeded_book_is_calibrated_by_class(place, calibrated):
    rates = ClassRates.load(place / "classes.toml")
    assert rates.evidence["seeds"] == [5]
    assert rates.evidence["plans"]["jacks"] == StudyPlan.load(place / "plan.toml").fingerprint
    for key, known in TRUTH.classes.items():
        assert rates.classes[key].low < known.rate < rates.classes[key].high
    assert {row["class"] for row in calibrated["classes"]} == set(rates.classes)


def test_the_table_of_rates(wellmixed_here, place, calibrated):
    said = wellmixed_here("calibrate", "plan.toml", "--out", "again.toml", cwd=place).out
    assert "join f1 + f2 touching 1" in said
    assert "break model: first-order" in said


def test_held_out_growth_is_as_predicted(wellmixed_here, place, calibrated):
    command = ["validate", "plan.toml", "--rates", "classes.toml", "--csv", "curves.csv", "--json"]
    done = wellmixed_here(*command, cwd=place).json
    assert done["is_consistent"]
    (comparison,) = done["comparisons"]
    assert [row["kind"] for row in comparison["events"]] == ["joins", "breaks"]
    assert "largest" in comparison["curves"]
    assert (place / "curves.csv").read_text(encoding="utf-8").startswith("label,time,curve,observed")


def test_wrong_rates_are_seen(place, calibrated):
    """All joins at a third of their rates."""
    plan, rates = StudyPlan.load(place / "plan.toml"), ClassRates.load(place / "classes.toml")
    slower = {
        key: entry.replace(exposure=3 * entry.exposure) if key.startswith("join") else entry
        for key, entry in rates.classes.items()
    }
    wrong = rates.replace(classes=slower)
    runs = StudyRuns.planned(plan, "held_out")
    study = run_growth_validation(runs, wrong, place / "runs", most_groups=399, progress=False)
    (comparison,) = study.comparisons
    assert comparison.groups == 399  # more were asked for
    (joins,) = (row for row in comparison.events if row.kind == "joins")
    assert joins.p == pytest.approx(2 / 400)
    assert joins.seen > joins.high
    assert comparison.table().startswith("from 20 monomers, 1 seed, 3 runs, compared with 399 predicted groups")


def test_growth_by_the_rules_reads_what_was_written(wellmixed_here, place, calibrated):
    command = ["rules", "grow", "jack13", "--cubes", "20", "--rates", "classes.toml", "--duration", "50", "--runs", "3"]
    made = wellmixed_here(*command, "--seeds", "2", "--posterior-draws", "3", "--json", cwd=place).json
    assert made["series"]["1 cube"]["mean"][0] == 22
    assert made["draws_of_rates"] == 3


def test_what_is_refused(wellmixed_here, place, calibrated):
    seen = StudyRuns.planned(StudyPlan.load(place / "plan.toml"), "calibration")
    rates = ClassRates.load(place / "classes.toml")
    with pytest.raises(ValueError, match="calibrated with seed 5 too"):
        run_growth_validation(seen, rates, place / "runs")
    elsewhere = rates.replace(tank=(3.0, 3.0, 3.0))
    held_out = replace(seen, seed=7)
    with pytest.raises(ValueError, match="calibrate in that one"):
        run_growth_validation(held_out, elsewhere, place / "runs")
    joins = rates.replace(classes={k: v for k, v in rates.classes.items() if k.startswith("join")})
    with pytest.raises(ValueError, match="no rate for class 'break"):
        run_growth_validation(held_out, joins, place / "runs")
    for options, said in (
        (["plan.toml", "--report", "x.html"], "--counts and --snapshots, not for classes; leave it out"),
        (["channels", "plan.toml", "--group-by", "event"], "--group-by is for calibrate classes, not for channels"),
        (["channels", "plan.toml", "line4"], "expected calibrate channels SCENE|PLAN|FOLDER"),
        (["plan.toml", "--tank", 2, 2, 3], "--tank is for --events"),
        (["plan.toml", "--cubes", "9"], "--cubes is fixed by the plan"),
    ):
        failed = wellmixed_here("calibrate", *options, "--out", "no.toml", cwd=place)
        assert failed.code == 2
        assert said in failed.err
