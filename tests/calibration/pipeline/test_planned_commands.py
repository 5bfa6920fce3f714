"""`calibrate` and `validate` with a plan in the place of a scene."""

import json
import sys

import pytest

from calibration.pipeline.plan import PlannedRuns, StudyPlan, Tanks
from kinetics.rates import Rates
from mechsim.runs.store import RunStore

MIXED = {"monomer": 6, "dimer": 4, "trimer": 3, "quadmer": 3}
MODELS = ["first-order", "collision", "collision-wall", "collision-species"]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("planned")
    StudyPlan(
        name="small",
        scene="line4",
        calibration=PlannedRuns(seed=5, tanks=[Tanks(composition=MIXED, runs=3, duration=1.5)]),
        held_out=PlannedRuns(seed=6, tanks=[Tanks(composition={"monomer": n}, runs=2, duration=1.0) for n in (8, 12)]),
    ).save(folder / "plan.toml")
    return folder


@pytest.fixture(scope="module")
def calibrated(wellmixed_here, place):
    command = ["calibrate", "plan.toml", "--out", "rates.toml", "--report", "calibration.html", "--json"]
    return wellmixed_here(*command, cwd=place).json


def test_a_plan_is_carried_out(wellmixed_here, place, calibrated):
    assert (calibrated["seed"], calibrated["evidence"]["plan"], calibrated["evidence"]["runs"]) == (5, "small", 3)
    rates = Rates.load(place / "rates.toml")
    assert rates.evidence["plan_hash"] == StudyPlan.load(place / "plan.toml").fingerprint
    done = wellmixed_here("validate", "plan.toml", "--rates", "rates.toml", "--json", cwd=place).json
    assert (done["plan"], done["seed"]) == ("small", 6)
    assert len(done["comparisons"]) == 2


def test_no_break_was_seen(wellmixed_here, place, calibrated):
    """In so short runs: no break model is chosen, and no table of them is shown."""
    assert sum(row["events"] for row in calibrated["channels"] if "->1+" in row["channel"]) == 0
    assert calibrated["breaks"] is None
    said = wellmixed_here("calibrate", "plan.toml", "--out", "again.toml", cwd=place).out
    page = (place / "calibration.html").read_text(encoding="utf-8")
    for where in (said, page, calibrated["evidence"]["break_model"]):
        assert "no breaks were seen: each rate is an upper limit (95 %)" in where
        assert "collision" not in where
    assert Rates.load(place / "rates.toml").breaks.model == "first-order"


def test_the_table_of_break_models(wellmixed_here, tmp_path):
    rows = [f"one,{row}" for row in ("0,start,0,0,6,0", *(f"{t},3->1+2,,,," for t in range(1, 7)), "9,end,,,,")]
    (tmp_path / "seen.csv").write_text(
        "\n".join(["run,time,channel,monomer,dimer,trimer,quadmer", *rows]), encoding="utf-8"
    )
    given = ["--tank", 2, 2, 3, "--break-model", "auto", "--out", "rates.toml"]
    command = ["calibrate", "line4", "--events", "seen.csv", *given]
    data = wellmixed_here(*command, "--report", "page.html", "--json", cwd=tmp_path).json
    breaks = data["breaks"]
    assert [row["model"] for row in breaks["models"]] == MODELS
    assert [row["model"] for row in breaks["models"] if row["is_chosen"]] == [breaks["chosen"]]
    assert Rates.load(tmp_path / "rates.toml").breaks.model == breaks["chosen"]
    assert breaks["reason"] in (tmp_path / "page.html").read_text(encoding="utf-8")
    said = wellmixed_here(*command, cwd=tmp_path).out
    assert f"* {breaks['reason']}." in said
    for model in MODELS:
        assert model in said


def test_another_break_model_is_asked_for(wellmixed_here, place, calibrated):
    command = ["calibrate", "plan.toml", "--out", "other.toml", "--break-model", "collision", "--json"]
    data = wellmixed_here(*command, cwd=place).json
    assert Rates.load(place / "other.toml").breaks.model == "collision"
    assert data["channels"] == calibrated["channels"]  # events and exposures of the same runs


def test_shards_of_a_plan(wellmixed_here, place, calibrated, tmp_path):
    rest = ["--missing", "--json"]
    assert calibrated["problems"] == []
    found = wellmixed_here("calibrate", "plan.toml", "--out", "x.toml", *rest, cwd=place).json
    assert (found["runs"], found["missing"]) == (3, [])
    (tmp_path / "plan.toml").write_bytes((place / "plan.toml").read_bytes())
    command = ["validate", "plan.toml", "--rates", place / "rates.toml", "--shard", "1/2", *rest]
    done = wellmixed_here(*command, cwd=tmp_path)
    assert done.code == 4
    assert len(json.loads(done.out)["missing"]) == 2


@pytest.mark.parametrize(
    ("command", "option"),
    [
        *((["calibrate", "--out", "x.toml"], [name, 5]) for name in ("--cubes", "--runs", "--duration", "--seed")),
        *((["validate", "--rates", "table3"], [name, 5]) for name in ("--cubes", "--runs", "--duration", "--seed")),
        (["calibrate", "--out", "x.toml"], ["--engine", "own"]),
        (["validate", "--rates", "table3"], ["--engine", "own"]),
    ],
)
def test_what_a_plan_fixes_is_no_option(wellmixed_here, place, command, option):
    done = wellmixed_here(command[0], "plan.toml", *command[1:], *option, cwd=place)
    assert (done.code, done.out) == (2, "")
    assert f"{option[0]} is fixed by the plan plan.toml" in done.err


def test_all_that_make_runs_take_another_engine(wellmixed_here, tmp_path, monkeypatch):
    """The scene's own is PyBullet, which is not there."""
    monkeypatch.setitem(sys.modules, "pybullet", None)
    monkeypatch.delitem(sys.modules, "mechsim.world.engines.pybullet_engine", raising=False)
    short = ["--cubes", 6, "--duration", 0.2, "--runs", 2, "--engine", "own", "--json"]
    assert wellmixed_here("simulate", "line4", *short, cwd=tmp_path).json["computed"] == 2
    part = [*short, "--shard", "1/1"]  # the runs alone
    assert wellmixed_here("calibrate", "line4", *part, "--out", "rates.toml", cwd=tmp_path).json["computed"] == 2
    assert wellmixed_here("validate", "line4", *part, "--rates", "table3", cwd=tmp_path).json["computed"] == 2
    stored = [manifest for manifest, _ in RunStore(tmp_path / "runs").contents()]
    assert {each["inputs"]["scene"]["numerics"]["engine"] for each in stored} == {"own"}
    assert len(stored) == 6  # of three seeds


@pytest.mark.parametrize("source", ["plan.toml", "line4"])
def test_an_unknown_break_model(wellmixed_here, place, source):
    done = wellmixed_here("calibrate", source, "--out", "x.toml", "--break-model", "magic", cwd=place)
    assert (done.code, done.out) == (2, "")
    assert "magic" in done.err
    assert not (place / "x.toml").exists()
