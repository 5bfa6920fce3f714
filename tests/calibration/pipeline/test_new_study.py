"""From a shape to a validated prediction, with the folder as the only word after each command."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from calibration.pipeline import growth_planner
from calibration.pipeline.new_study import (
    BREAK,
    JOIN,
    PLACE,
    _source_of,
    extent,
    guessed_rates,
    new_study,
    plain_name,
    scene_for,
)
from calibration.pipeline.plan import StudyPlan
from kinetics.assembly import RuleBook, derive
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.compiler.yields import yields_of
from kinetics.assembly.rules.rule_book import BOOKS
from kinetics.assembly.rules.writing import written
from kinetics.networkfree import grow
from kinetics.rates import ClassRates, Rates
from mechsim.runs.store import RunStore
from mechsim.scene import Scene
from wellmixed import main

RESULTS = Path(__file__).parents[3] / "results"
ROW_OF_THREE, S_OF_FOUR = 'layers = ["###"]\n', 'layers = ["""\n##.\n.##"""]\n'
SEEDED = 'layers = ["###"]\nseed = [1, 0, 0]\nbreaks = false\n'
SHORT = ("--cubes", "12", "--held-out", "12", "--duration", "20", "--held-out-duration", "20")
BUDGET = 0.001  # CPU hours; a pilot measures what runs cost, so there must be room for a slow moment
SMALL = (*SHORT, "--along", "800")
RUN = {"composition": {"monomer": 2}, "runs": 2, "duration": 1.0}
PLAN = {"scene": "line4", "calibration": {"seed": 1, "tanks": [RUN]}, "held_out": {"seed": 2, "tanks": [RUN]}}
LARGE = ("--cubes", "60", "--held-out", "40", "--along", "200", "--duration", "200", "--held-out-duration", "500")


def run(*words, code=0):
    found = CliRunner().invoke(main, [str(word) for word in words])
    assert found.exit_code == code, found.output
    return found.output


def first_line(said):
    """Of a verdict: where work is slow, forecasts of standard error come before it."""
    return next(line for line in said.splitlines() if not line.startswith("forecast: "))


def made_in(parent, shape, options, hours):
    """The folder of a shape, and what `new` said of it."""
    (parent / "mine.toml").write_text(shape, encoding="utf-8")
    said = run("new", parent / "mine.toml", parent / "made", *options, "--cpu-hours", hours, "--json")
    return parent / "made", json.loads(said[said.index("{") : said.rindex("}") + 1])


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return made_in(tmp_path_factory.mktemp("studies"), ROW_OF_THREE, SMALL, BUDGET)


class Blank:
    """In the place of a report, whose figures take longer than all the rest; they have tests of their own."""

    def __init__(self, *_):
        pass

    def write(self, path, data):
        Path(path).touch()


def test_a_folder_goes_the_whole_way(study, tmp_path, monkeypatch):
    folder, made = study
    monkeypatch.setattr("calibration.commands.calibrate.calibration_report", Blank)
    monkeypatch.setattr("calibration.commands.validate.validation_report", Blank)
    monkeypatch.chdir(tmp_path)
    assert sorted(path.name for path in folder.iterdir()) == ["book.toml", "plan.toml", "scene.toml", "target.toml"]
    assert (folder / "target.toml").read_text(encoding="utf-8") == ROW_OF_THREE
    assert made["calibration_cpu_seconds"] + made["held_out_cpu_seconds"] <= BUDGET * 3600
    assert Path(StudyPlan.load(folder / "plan.toml").scene) == folder / "scene.toml"
    assert "holds no rates.toml yet" in run("predict", folder, code=2)
    assert "12" in run("simulate", folder, "--duration", "1")
    run("calibrate", folder)
    brief = ("--runs", "20", "--posterior-draws", "2", "--duration", "20", "--json")
    for words, copies in ((), 12), (("--initial", "monomer=8"), 8), (("--cubes", "9"), 9):
        assert json.loads(run("predict", folder, *words, *brief))["initial"] == {
            "monomer": copies,
            "dimer": 0,
            "trimer": 0,
        }
    assert first_line(run("validate", folder)).startswith("Rules of the plan: ")
    assert {"rates.toml", "runs", "calibration.html", "validation.html"} <= {path.name for path in folder.iterdir()}
    assert not list(tmp_path.iterdir()), "nothing is written outside the folder"
    plan = StudyPlan.load(shutil.copytree(folder, tmp_path / "moved") / "plan.toml")
    specs = plan.specs(plan.calibration) + plan.specs(plan.held_out)
    assert len(RunStore(tmp_path / "moved" / "runs").existing(specs)) == len(specs), "runs are found elsewhere too"
    plan.replace(verdict=plan.verdict.replace(p_pit=1.0)).save(tmp_path / "moved" / "plan.toml")
    broken = run("validate", tmp_path / "moved", code=5)
    assert "1 broken (p of the PIT of all single runs above 1: p = " in first_line(broken)
    assert "as the rates that are judged" in run("validate", folder, "--control", folder / "rates.toml", code=2)


def test_a_target_that_grows_from_a_seed_is_studied_by_class(tmp_path):
    folder, made = made_in(tmp_path, SEEDED, SHORT, BUDGET)
    plan = StudyPlan.load(folder / "plan.toml")
    (held,) = plan.held_out.tanks
    assert held.composition == {"monomer": 10, "seed": 2}  # cubes for twice as many targets
    assert made["calibration_cpu_seconds"] + made["held_out_cpu_seconds"] <= BUDGET * 3600
    assert "reaches a half-width of" in made["shortfalls"][0]
    assert [row["rate"] for row in made["rates"]] == ["joins"]
    assert "rates written" in run("calibrate", folder)
    assert set(ClassRates.load(folder / "rates.toml").classes) == {"join", "join touching 1"}
    begun = json.loads(run("predict", folder, "--runs", "5", "--duration", "20", "--json"))
    assert (begun["initial"]["monomer"], begun["initial"]["seed"]) == (10, 2)
    with pytest.raises(ValueError, match="are not enough for a run that shows each rate"):
        new_study(str(folder / "target.toml"), tmp_path / "poor", cpu_hours=1e-9, cubes=(12,), held_out=(12,))


def test_a_book_is_used_as_it_is(tmp_path):
    """Neither compiled nor written anew; a target of the same name is something else."""
    mine = tmp_path / "pairs.toml"
    mine.write_text("# by hand\n" + (BOOKS / "line4_pairs.toml").read_text(encoding="utf-8"), encoding="utf-8")
    said = run("new", mine, tmp_path / "made", *SMALL, "--cpu-hours", BUDGET, "--json")
    data = json.loads(said[said.index("{") : said.rindex("}") + 1])
    assert (tmp_path / "made" / "book.toml").read_bytes() == mine.read_bytes()
    assert not (tmp_path / "made" / "target.toml").exists()
    yields = yields_of(derive(RuleBook.load("line4_pairs")))
    assert data["yields"]["no_breaks"] == yields.holding
    assert (data["gain"], data["verified"], data["letters"]) == (None, [], 3)
    specs = StudyPlan.load(tmp_path / "made" / "plan.toml")
    assert specs.specs(specs.calibration)
    assert [_source_of(name)[0] for name in ("line4_pairs", "line4", "corner", str(mine))] == [True, False, False, True]
    assert "unknown target or rule book 'neither'" in run("new", "neither", tmp_path / "none", code=2)


def test_a_low_yield_is_warned_of(tmp_path, study):
    assert study[1]["yields"]["no_breaks"] > 0.1
    mine = tmp_path / "slow.toml"
    mine.write_text(written(compile_book(Target.load("screw"), joins=["1+1", "1+2", "1+3"]).book), encoding="utf-8")
    small = ("--cubes", "40", "--held-out", "12", "--along", "200", "2000", "--cpu-hours", "1")
    low, high = run("new", mine, tmp_path / "low", *small), run("new", "line4_pairs", tmp_path / "high", *small)
    assert "warning: yield below 0.1" in low
    assert "warning: yield" not in high
    assert "yield 0.9" in high


def test_an_engine_is_offered_and_taken(tmp_path, study, monkeypatch):
    """Our own engine is offered for the same runs, unless it was chosen already or is no faster."""

    class Costs:
        own = 0.25

        def __init__(self, _):
            pass

        def __call__(self, spec):
            return spec.duration * spec.n_cubes * 1e-4 * (self.own if spec.scene.numerics.engine == "own" else 1.0)

    monkeypatch.setattr("calibration.pipeline.new_study.RunCosts", Costs)
    wide = {"width": 0.5, "cubes": (12,), "held_out": (12,), "along": (0.0, 800.0)}
    usual, own = (
        new_study("l3", tmp_path / f"made-{engine}", engine=engine, **wide).planned for engine in (None, "own")
    )
    assert usual.gains == {"own": pytest.approx(4.0)}
    assert own.gains == {}
    total, other = (made.calibration_seconds + made.held_out_seconds for made in (usual, own))
    assert other == pytest.approx(total / 4)
    assert usual.to_dict()["other_engines"][0]["cpu_seconds"] == pytest.approx(other)
    assert f"CPU time with --engine own: calibration {own.calibration_seconds / 3600:.2f} h" in usual.cost
    assert Scene.load(tmp_path / "made-own" / "scene.toml").numerics.engine == "own"
    plan = StudyPlan.load(tmp_path / "made-own" / "plan.toml")
    assert {spec.scene.numerics.engine for spec in plan.specs(plan.calibration)} == {"own"}
    monkeypatch.setattr(Costs, "own", 0.9)  # the control
    assert new_study("l3", tmp_path / "slow", **wide).planned.gains == {}


def test_ctrl_c_ends_the_plan_of_growth(tmp_path, monkeypatch):
    """Runs that were not all made are no forecast."""
    (tmp_path / "target.toml").write_text(SEEDED, encoding="utf-8")
    monkeypatch.setattr(growth_planner, "grow", lambda *given: replace(grow(*given), interrupted=True))
    with pytest.raises(KeyboardInterrupt):
        new_study(str(tmp_path / "target.toml"), tmp_path / "made", cpu_hours=0.01, cubes=(12,), held_out=(12,))
    assert not (tmp_path / "made").exists()


@pytest.mark.validate
def test_growth_from_a_seed_goes_the_whole_way(tmp_path):
    folder, _ = made_in(tmp_path, SEEDED, ("--cubes", "24", "--held-out", "24", "--duration", "200"), 0.03)
    run("calibrate", folder)
    assert "consistent with the prediction in all" in run("validate", folder)


@pytest.mark.validate
def test_an_s_of_four_goes_the_whole_way(tmp_path):
    folder, made = made_in(tmp_path, S_OF_FOUR, LARGE, 0.1)
    assert made["letters"] <= 3
    run("calibrate", folder)
    assert "quadmer" in run("predict", folder)
    assert "consistent with the prediction in all" in run("validate", folder)


def test_it_is_made_whole_or_not_at_all(study, tmp_path):
    folder, _ = study
    said = run("new", folder / "target.toml", folder, code=2)
    assert "already exists" in said
    assert "the folder of" in run("new", "corner", tmp_path / "no" / "where", code=2)
    assert "holds no scene.toml" in run("simulate", tmp_path, code=2)
    with pytest.raises(ValueError, match="are not enough"):
        new_study(folder / "target.toml", tmp_path / "poor", cpu_hours=1e-9, cubes=(12,), held_out=(12,), along=(0.0,))
    assert not list(tmp_path.iterdir())


def near_enough(is_join, rate):
    guess, factor = (JOIN, 1.6) if is_join else (BREAK, 6.0)
    return guess / factor < rate < guess * factor


def test_the_guess_is_as_near_as_it_says_for_ts():
    """Against the rates that were measured, where there are events enough to tell."""
    derivation = derive(RuleBook.load("t5"))
    rates = Rates.load(RESULTS / "t5" / "rates.toml")
    assert rates.tank == PLACE
    measured = ClassRates.of_rates(derivation, rates)
    for rate_class in derivation.rate_classes:
        entry = measured.classes[str(rate_class)]
        assert entry.events < 10 or near_enough(rate_class.event == "join", entry.rate), rate_class


def test_the_guess_is_as_near_as_it_says_for_lines():
    """Joins under mass action; breaks as events over exposure, the mean over the calibration tanks."""
    joins = Rates.load(RESULTS / "line4" / "uncrowded.toml")
    assert joins.tank == PLACE
    for row in pd.read_csv(RESULTS / "line4" / "calibration_rates.csv").to_dict("records"):
        is_join = "+" in row["channel"].split("->")[0]
        assert row["events"] >= 10
        assert near_enough(is_join, joins.channels[row["channel"]].rate if is_join else row["rate"]), row["channel"]


def test_the_guess_follows_the_tank():
    derivation = derive(RuleBook.load("line4"))
    small, large = (guessed_rates(derivation, tuple(f * edge for edge in PLACE)) for f in (1.0, 2.0))
    joins = [name for name in small.channels if "+" in name.split("->")[0]]
    for name, channel in small.channels.items():
        factor = 8.0 if name in joins else 1.0
        assert channel.rate == pytest.approx(factor * large.channels[name].rate)


@pytest.mark.parametrize(
    ("name", "plain"),
    [("mine", "mine"), ("mein Würfel", "mein-Wurfel"), ("._3x3", "3x3"), ("立方", "study"), ("a" * 99, "a" * 80)],
)
def test_a_study_is_named_after_its_target(name, plain):
    assert plain_name(name) == plain
    assert StudyPlan(**PLAN | {"name": plain}).name == plain
    if name != plain:
        with pytest.raises(ValueError, match="name"):
            StudyPlan(**PLAN | {"name": name})


def test_a_scene_suits_its_target():
    line, tee = (scene_for(name, derive(RuleBook.load(name))) for name in ("line4", "t5"))
    assert line.tank.size == PLACE
    assert line.effect("breaking") == Scene.load("line4").effect("breaking")
    assert tee.effect("breaking") == Scene.load("t5").effect("breaking")
    longest = derive(RuleBook.load("line4")).structures["quadmer"]
    assert extent(longest) == pytest.approx(np.sqrt(16 + 1 + 1))
