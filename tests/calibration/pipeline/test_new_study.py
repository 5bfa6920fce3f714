"""From a shape to a validated prediction, with the folder as the only word after each command."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from calibration.pipeline.new_study import BREAK, JOIN, PLACE, extent, guessed_rates, new_study, scene_for
from calibration.pipeline.plan import StudyPlan
from kinetics.assembly import RuleBook, derive
from kinetics.rates import ClassRates, Rates
from mechsim.scene import Scene
from wellmixed import main

RESULTS = Path(__file__).parents[3] / "results"
ROW_OF_THREE, S_OF_FOUR = 'layers = ["###"]\n', 'layers = ["""\n##.\n.##"""]\n'
SMALL = ("--cubes", "16", "--held-out", "16", "--along", "800", "--duration", "60", "--held-out-duration", "60")
LARGE = ("--cubes", "60", "--held-out", "40", "--along", "200", "--duration", "200", "--held-out-duration", "500")


def run(*words, code=0):
    found = CliRunner().invoke(main, [str(word) for word in words])
    assert found.exit_code == code, found.output
    return found.output


def made_in(parent, shape, options, hours):
    """The folder of a shape, and what `new` said of it."""
    (parent / "mine.toml").write_text(shape, encoding="utf-8")
    said = run("new", parent / "mine.toml", parent / "made", *options, "--cpu-hours", hours, "--json")
    return parent / "made", json.loads(said[said.index("{") : said.rindex("}") + 1])


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return made_in(tmp_path_factory.mktemp("studies"), ROW_OF_THREE, SMALL, 0.004)


def test_a_folder_goes_the_whole_way(study, tmp_path, monkeypatch):
    folder, made = study
    monkeypatch.chdir(tmp_path)
    assert sorted(path.name for path in folder.iterdir()) == ["book.toml", "plan.toml", "scene.toml", "target.toml"]
    assert (folder / "target.toml").read_text(encoding="utf-8") == ROW_OF_THREE
    assert made["calibration_cpu_seconds"] + made["held_out_cpu_seconds"] <= 0.004 * 3600
    assert Path(StudyPlan.load(folder / "plan.toml").scene) == folder / "scene.toml"
    assert "holds no rates.toml yet" in run("predict", folder, code=2)
    run("simulate", folder, "--duration", "5")
    run("calibrate", folder)
    assert "trimer" in run("predict", folder)
    assert "trimer" in run("predict", folder, "--initial", "monomer=8")
    assert "rule:" in run("validate", folder)
    assert {"rates.toml", "runs", "calibration.html", "validation.html"} <= {path.name for path in folder.iterdir()}
    assert not list(tmp_path.iterdir()), "nothing is written outside the folder"
    runs = sorted(path.name for path in (folder / "runs").glob("*.run"))
    moved = shutil.copytree(folder, tmp_path / "moved")
    run("calibrate", moved)
    assert sorted(path.name for path in (moved / "runs").glob("*.run")) == runs, "no run is made again elsewhere"


@pytest.mark.validate
def test_an_s_of_four_goes_the_whole_way(tmp_path):
    folder, made = made_in(tmp_path, S_OF_FOUR, LARGE, 0.1)
    assert made["letters"] == 3
    run("calibrate", folder)
    assert "quadmer" in run("predict", folder)
    assert "consistent with the prediction in all" in run("validate", folder)


def test_it_is_made_whole_or_not_at_all(study, tmp_path):
    folder, _ = study
    said = run("new", folder / "target.toml", folder, code=2)
    assert "is there already" in said
    assert "the folder of" in run("new", "corner", tmp_path / "no" / "where", code=2)
    assert "grows from a seed" in run("new", "plate4x4", tmp_path / "grown", code=2)
    assert "holds no scene.toml" in run("simulate", tmp_path, code=2)
    with pytest.raises(ValueError, match="do not pay"):
        new_study("corner", tmp_path / "poor", cpu_hours=1e-9, cubes=(12,), held_out=(12,), along=(0.0,))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["line4", "t5"])
def test_the_guess_is_as_near_as_it_says(name):
    """Against the rates that were measured, where there are events enough to tell."""
    derivation = derive(RuleBook.load(name))
    rates = Rates.load(RESULTS / name / "control-rates.toml")
    assert rates.tank == PLACE
    measured = ClassRates.of_rates(derivation, rates)
    for rate_class in derivation.rate_classes:
        entry = measured.classes[str(rate_class)]
        if entry.events >= 10:
            guess, factor = (JOIN, 1.6) if rate_class.event == "join" else (BREAK, 6.0)
            assert guess / factor < entry.rate < guess * factor, rate_class


def test_the_guess_follows_the_tank():
    derivation = derive(RuleBook.load("line4"))
    small, large = (guessed_rates(derivation, tuple(f * edge for edge in PLACE)) for f in (1.0, 2.0))
    joins = [name for name in small.channels if "+" in name.split("->")[0]]
    for name, channel in small.channels.items():
        factor = 8.0 if name in joins else 1.0
        assert channel.rate == pytest.approx(factor * large.channels[name].rate)


def test_a_scene_suits_its_target():
    line, tee = (scene_for(name, derive(RuleBook.load(name))) for name in ("line4", "t5"))
    assert line.tank.size == PLACE
    assert line.effect("breaking") == Scene.load("line4").effect("breaking")
    assert tee.effect("breaking") == Scene.load("t5").effect("breaking")
    longest = derive(RuleBook.load("line4")).structures["quadmer"]
    assert extent(longest) == pytest.approx(np.sqrt(16 + 1 + 1))
