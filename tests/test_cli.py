"""Every command end to end, as a user has it: in a process of its own, its output in pipes."""

import json
import os
import signal
import subprocess
import time
import tomllib
from pathlib import Path

import pandas as pd
import pytest
from command_line import COMMAND

SPECIES = ["monomer", "dimer", "trimer", "quadmer"]
CHANNELS = ["1+1->2", "1+2->3", "1+3->4", "2+2->4", "2->1+1", "3->1+2", "4->1+3", "4->2+2"]
SIMULATE = ["simulate", "line4", "--cubes", 60, "--duration", 5, "--runs", 2, "--seed", 1]
LONG = ["simulate", "line4", "--cubes", 60, "--duration", 20, "--runs", 6, "--seed", 1, "--workers", 2, "--json"]
CALIBRATE = ["calibrate", "line4", "--out", "rates.toml", "--join-time", 30, "--break-time", 30, "--workers", 2]
VALIDATE = ["validate", "line4", "--rates", "rates.toml", "--cubes", 60, 80, "--runs", 2, "--duration", 10]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """One folder for the commands that build on each other."""
    return tmp_path_factory.mktemp("study")


@pytest.fixture(scope="module")
def simulated(wellmixed, place):
    return wellmixed(*SIMULATE, "--workers", 2, "--json", cwd=place)


@pytest.fixture(scope="module")
def calibrated(wellmixed, place):
    return wellmixed(*CALIBRATE, "--report", "calibration.html", "--json", cwd=place)


def test_simulate(simulated):
    assert simulated.err == ""
    data = simulated.json
    assert (data["species"], data["channels"], data["target"]) == (SPECIES, CHANNELS, "quadmer")
    assert data["initial"] == {"monomer": 60}
    assert [run["run"] for run in data["runs"]] == [0, 1]
    assert (data["computed"], data["reused"], data["quarantined"]) == (2, 0, [])
    for run in data["runs"]:
        assert run["outcome"] == "completed"
        assert run["end"] == pytest.approx(5, abs=0.00525)
        assert sum(n * (SPECIES.index(name) + 1) for name, n in run["final"].items()) == 60
        assert set(run["events"]) <= set(CHANNELS)
        assert (run["target"], run["first_target"]) == (0, None)
    assert data["runs"][0]["digest"] != data["runs"][1]["digest"]


def test_simulate_again_finds_every_run(wellmixed, place, simulated):
    again = wellmixed(*SIMULATE, "--workers", 2, "--json", cwd=place).json
    assert (again["computed"], again["reused"]) == (0, 2)
    assert again["digest"] == simulated.json["digest"]


def test_simulate_with_another_number_of_workers(wellmixed, tmp_path, simulated):
    alone = wellmixed(*SIMULATE, "--workers", 1, "--json", cwd=tmp_path).json
    assert alone["computed"] == 2
    assert alone["digest"] == simulated.json["digest"]
    other = wellmixed(*SIMULATE[:-1], 2, "--json", cwd=tmp_path).json
    assert other["digest"] != alone["digest"]


def test_simulate_for_people(wellmixed, place, simulated):
    done = wellmixed(*SIMULATE, "--picture", "tank.png", "--plot", "counts.svg", cwd=place)
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    occurred = [name for name in SPECIES[:3] if name in lines[0]]
    assert lines[0].split() == [
        *("run", *occurred, "quadmer", "largest", "first", "quadmer", "(tu)", "events", "CPU", "(s)", "outcome"),
    ]
    assert len(lines) == 1 + 2 + 1
    assert (place / "tank.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (place / "counts.svg").read_text(encoding="utf-8")


def test_progress_is_shown_where_it_is_asked_for(wellmixed, place, simulated):
    done = wellmixed(*SIMULATE, "--progress", "--json", cwd=place)
    assert done.json["reused"] == 2
    assert "2/2 runs" in done.err


def test_without_bonding_nothing_joins(wellmixed, tmp_path):
    tank = ["simulate", "line4", "--initial", "monomer=20,dimer=20", "--duration", 20, "--seed", 1, "--json"]
    joins = CHANNELS[:4]
    (run,) = wellmixed(*tank, cwd=tmp_path).json["runs"]
    assert set(run["events"]) & set(joins)
    (run,) = wellmixed(*tank, "--without", "bonding", cwd=tmp_path).json["runs"]
    assert not set(run["events"]) & set(joins)
    (run,) = wellmixed(*tank, "--without", "bonding", "--without", "breaking", cwd=tmp_path).json["runs"]
    assert run["events"] == {}


def test_a_run_that_the_guard_stops_gives_exit_code_4(wellmixed, tmp_path):
    shipped = Path(__file__).parents[1] / "mechsim" / "scenes" / "line4.toml"
    scene = shipped.read_text(encoding="utf-8") + "\n[guard]\nmax_speed = 0.5\n"
    (tmp_path / "slow.toml").write_text(scene, encoding="utf-8")
    done = wellmixed("simulate", "slow.toml", "--cubes", 10, "--duration", 5, "--json", cwd=tmp_path)
    assert done.code == 4
    (run,) = json.loads(done.out)["runs"]
    assert run["outcome"].startswith("stopped: ")
    assert run["end"] < 5
    done = wellmixed("calibrate", "slow.toml", "--out", "rates.toml", *CALIBRATE[4:], cwd=tmp_path)
    assert done.code == 2
    assert "no calibration run reached its end" in done.err
    assert not (tmp_path / "rates.toml").exists()


def test_export(wellmixed, place, simulated):
    done = wellmixed("export", "runs", "--out", "tables", "--json", cwd=place)
    assert done.err == ""
    assert sorted(Path(name).name for name in done.json["written"]) == [
        *("events.csv", "events.parquet", "runs.csv", "runs.parquet"),
    ]
    for name in ("runs", "events"):
        parquet, csv = pd.read_parquet(place / f"tables/{name}.parquet"), pd.read_csv(place / f"tables/{name}.csv")
        assert list(parquet) == list(csv)
        assert len(parquet) == len(csv)
    runs, events = (pd.read_parquet(place / f"tables/{name}.parquet") for name in ("runs", "events"))
    rows = {run["key"]: run for run in simulated.json["runs"]}
    assert set(rows) <= set(runs["key"])
    for key, run in rows.items():
        assert (events["key"] == key).sum() == sum(run["events"].values())


def test_calibrate(place, calibrated):
    assert calibrated.err == ""
    data = calibrated.json
    assert [row["channel"] for row in data["channels"]] == CHANNELS
    assert [row["ways"] for row in data["channels"]] == [4, 4, 4, 4, 1, 2, 2, 1]
    for row in data["channels"]:
        assert 0 <= row["low"] <= row["rate"] <= row["high"]
        assert row["rate"] == pytest.approx(row["events"] / row["exposure"])
    assert data["problems"] == []
    rates = tomllib.loads((place / "rates.toml").read_text(encoding="utf-8"))
    assert rates["convention"]["combinations"] == "distinct"
    assert rates["evidence"]["seed"] == data["seed"] == 1
    assert {name: channel["events"] for name, channel in rates["channels"].items()} == {
        row["channel"]: row["events"] for row in data["channels"]
    }
    assert "Rates of line4" in (place / "calibration.html").read_text(encoding="utf-8")


def test_calibrate_again_writes_the_same_rates(wellmixed, place, calibrated):
    before = (place / "rates.toml").read_bytes()
    done = wellmixed(*CALIBRATE, cwd=place)
    assert (done.code, done.err) == (0, "")
    assert done.out.splitlines()[-1] == "rates written to rates.toml"
    assert (place / "rates.toml").read_bytes() == before


@pytest.mark.parametrize("rates", ["table3", "rates.toml"])
@pytest.mark.parametrize("method", ["ssa", "exact"])
def test_predict(wellmixed, place, calibrated, rates, method):
    command = [
        "predict",
        "line4",
        "--rates",
        rates,
        "--cubes",
        60,
        "--method",
        method,
        "--times",
        10,
        50,
        100,
        "--json",
    ]
    done = wellmixed(*command, "--seed", 3, cwd=place)
    assert done.err == ""
    data = done.json
    assert data["times"] == [10, 50, 100]
    assert data["species"] == SPECIES
    for table in (data["mean"], data["sd"]):
        assert [len(row) for row in table] == [4, 4, 4]
    for row in data["mean"]:
        assert sum(value * (i + 1) for i, value in enumerate(row)) == pytest.approx(60)
    assert (data["interval"] is not None) == (rates == "rates.toml")
    again = wellmixed(*command, "--seed", 3, cwd=place).json
    assert again | {"cpu_seconds": 0} == data | {"cpu_seconds": 0}
    other = wellmixed(*command, "--seed", 4, cwd=place).json
    assert (other["mean"] == data["mean"]) == (method == "exact")


@pytest.mark.parametrize(("rates", "species"), [("table3", "quadmer"), ("rates.toml", "dimer")])
def test_passage(wellmixed, place, calibrated, rates, species):
    command = ["passage", "line4", "--rates", rates, "--cubes", 60, "--species", species, "--json"]
    done = wellmixed(*command, cwd=place)
    assert done.err == ""
    data = done.json
    waits = list(data["quantiles"].values())
    assert list(data["quantiles"]) == ["0.025", "0.25", "0.5", "0.75", "0.975"]
    assert waits == sorted(waits)
    assert waits[0] < data["mean"] < waits[-1]
    assert data["sd"] > 0
    assert (data["interval"] is not None) == (rates == "rates.toml")
    again = wellmixed(*command, cwd=place).json
    assert again | {"cpu_seconds": 0} == data | {"cpu_seconds": 0}


def test_derive(wellmixed, tmp_path):
    data = wellmixed("derive", "line4", "--json", cwd=tmp_path).json
    assert data["species"] == SPECIES
    assert [row["name"] for row in data["channels"]] == CHANNELS


def test_validate(wellmixed, place, calibrated):
    done = wellmixed(*VALIDATE, "--report", "validation.html", "--json", cwd=place)
    assert done.err == ""
    data = done.json
    assert [each["summary"]["label"] for each in data["comparisons"]] == ["60 cubes", "80 cubes"]
    for each in data["comparisons"]:
        assert {"coverage", "crps", "first_predicted", "cpu_mechanics_s", "cpu_ssa_s"} <= set(each["summary"])
        assert each["species"] == SPECIES
        assert len(each["table"]) == 41 * 4
    assert "Predicted against simulated" in (place / "validation.html").read_text(encoding="utf-8")
    again = wellmixed(*VALIDATE, cwd=place)
    assert (again.code, again.err) == (0, "")
    assert [line.split()[0] for line in again.out.splitlines()[:3]] == ["size", "60", "80"]


def test_demo(wellmixed, tmp_path):
    done = wellmixed("demo", "--scale", 0.1, "--workers", 2, "--json", cwd=tmp_path)
    assert done.err == ""
    data = done.json
    assert [row["channel"] for row in data["channels"]] == CHANNELS
    assert [row["label"] for row in data["summary"]] == ["60 cubes", "80 cubes", "120 cubes"]
    report = (tmp_path / data["report"]).read_text(encoding="utf-8")
    assert (tmp_path / data["rates"]).is_file()
    for row in data["channels"]:
        assert row["channel"].replace(">", "&gt;") in report
    assert report.count("<img") >= 5
    for reference in ("http://", "https://", "<script", "<link"):  # self-contained
        assert reference not in report


@pytest.fixture(scope="module")
def undisturbed(wellmixed, tmp_path_factory):
    """The digest that the long command gives when nobody disturbs it."""
    return wellmixed(*LONG, cwd=tmp_path_factory.mktemp("undisturbed")).json["digest"]


def start_and_wait_for_a_run(place: Path) -> subprocess.Popen:
    """The long command at work, its first run finished, others under way."""
    command = [str(COMMAND), *map(str, LONG)]
    process = subprocess.Popen(command, cwd=place, stdout=-1, stderr=-1, text=True, start_new_session=True)
    deadline = time.monotonic() + 120
    while not list(place.glob("runs/*.run")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return process


def test_ctrl_c(wellmixed, tmp_path, undisturbed):
    process = start_and_wait_for_a_run(tmp_path)
    os.killpg(process.pid, signal.SIGINT)  # a terminal sends it to all processes of the command
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == ""
    assert err == "Interrupted: what was finished is kept; the same command goes on from there.\n"
    kept = len(list(tmp_path.glob("runs/*.run")))
    assert 1 <= kept < 6
    data = wellmixed(*LONG, cwd=tmp_path).json
    assert (data["reused"], data["computed"]) == (kept, 6 - kept)
    assert data["digest"] == undisturbed


def test_kill_9(wellmixed, tmp_path, undisturbed):
    process = start_and_wait_for_a_run(tmp_path)
    process.kill()
    process.communicate(timeout=60)  # returns once the workers are gone too, for they hold the same pipes
    kept = len(list(tmp_path.glob("runs/*.run")))
    assert 1 <= kept < 6
    done = wellmixed(*LONG, cwd=tmp_path)
    assert done.err == ""
    assert (done.json["reused"], done.json["computed"]) == (kept, 6 - kept)
    assert done.json["digest"] == undisturbed
