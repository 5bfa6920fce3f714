"""Every command from end to end: once in a process of its own, as a user has it, and again in this one where that is
cheaper.

The demonstration makes a calibration and held-out runs; `calibrate` and `validate` then find these runs in its folder.
"""

import html
import json
import os
import re
import signal
import subprocess
import time
import tomllib
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest
from command_line import COMMAND, run_here, told

from calibration import DIAGNOSTICS
from mechsim.runs.record import RunSpec
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

SPECIES = ["monomer", "dimer", "trimer", "quadmer"]
CHANNELS = ["1+1->2", "1+2->3", "1+3->4", "2+2->4", "2->1+1", "3->1+2", "4->1+3", "4->2+2"]
JOINS = CHANNELS[:4]
SIMULATE = ["simulate", "line4", "--cubes", 60, "--duration", 5, "--runs", 2, "--seed", 1]
# What `demo --scale 0.08` asks for, command by command. A much shorter demo ends before any run holds a quadmer.
DEMO = ["demo", "--scale", 0.08, "--workers", 2]
CALIBRATE = ["calibrate", "line4", "--runs", 10, "--duration", 18, "--runs-folder", "demo-output/runs"]
VALIDATE = ["validate", "line4", "--runs", 4, "--duration", 12, "--runs-folder", "demo-output/runs"]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """One folder for the commands that build on each other."""
    return tmp_path_factory.mktemp("study")


@pytest.fixture(scope="module")
def simulated(wellmixed, place):
    return wellmixed(*SIMULATE, "--workers", 2, "--json", cwd=place)


@pytest.fixture(scope="module")
def demonstrated(wellmixed, place):
    return wellmixed(*DEMO, "--json", cwd=place)


@pytest.fixture(scope="module")
def calibrated(wellmixed, place, demonstrated):
    options = ["--out", "rates.toml", "--report", "calibration.html", "--json"]
    return wellmixed(*CALIBRATE, *options, cwd=place)


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


def test_simulate_again_finds_every_run_and_shows_progress_where_it_is_asked_for(wellmixed_here, place, simulated):
    again = wellmixed_here(*SIMULATE, "--workers", 2, "--progress", "--json", cwd=place)
    assert (again.json["computed"], again.json["reused"]) == (0, 2)
    assert again.json["digest"] == simulated.json["digest"]
    assert "2/2 runs" in again.err


def test_simulate_with_another_number_of_workers(wellmixed_here, tmp_path, simulated):
    alone = wellmixed_here(*SIMULATE, "--workers", 1, "--json", cwd=tmp_path).json
    assert alone["computed"] == 2
    assert alone["digest"] == simulated.json["digest"]
    other = wellmixed_here(*SIMULATE[:-1], 2, "--json", cwd=tmp_path).json
    assert other["digest"] != alone["digest"]


def test_simulate_for_people(wellmixed_here, place, simulated):
    done = wellmixed_here(*SIMULATE, "--picture", "tank.png", "--plot", "counts.svg", cwd=place)
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    occurred = [name for name in SPECIES[:3] if name in lines[0]]
    assert lines[0].split() == [
        *("run", *occurred, "quadmer", "largest", "first", "quadmer", "(tu)", "events", "CPU", "(s)", "outcome"),
    ]
    assert len(lines) == 1 + 2 + 1
    assert (place / "tank.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (place / "counts.svg").read_text(encoding="utf-8")


def test_effects_that_are_left_out_do_nothing(wellmixed_here, tmp_path):
    shipped = Path(__file__).parents[1] / "mechsim" / "scenes" / "line4.toml"
    scene = shipped.read_text(encoding="utf-8").replace("probability = 0.09", "probability = 1.0")
    (tmp_path / "eager.toml").write_text(scene, encoding="utf-8")
    tank = ["simulate", "eager.toml", "--initial", "monomer=20,dimer=20", "--duration", 8, "--seed", 1, "--json"]
    (run,) = wellmixed_here(*tank, cwd=tmp_path).json["runs"]
    assert sum(n for channel, n in run["events"].items() if channel in JOINS) > 3  # the control: some ten are expected
    (run,) = wellmixed_here(*tank, "--without", "bonding", cwd=tmp_path).json["runs"]
    assert not set(run["events"]) & set(JOINS)
    (run,) = wellmixed_here(*tank, "--without", "bonding", "--without", "breaking", cwd=tmp_path).json["runs"]
    assert run["events"] == {}


def test_a_run_that_the_guard_stops_gives_exit_code_4(wellmixed, wellmixed_here, tmp_path):
    shipped = Path(__file__).parents[1] / "mechsim" / "scenes" / "line4.toml"
    scene = shipped.read_text(encoding="utf-8") + "\n[guard]\nmax_speed = 0.5\n"
    (tmp_path / "slow.toml").write_text(scene, encoding="utf-8")
    done = wellmixed("simulate", "slow.toml", "--cubes", 10, "--duration", 5, "--json", cwd=tmp_path)
    assert done.code == 4
    (run,) = json.loads(done.out)["runs"]
    assert run["outcome"].startswith("stopped: ")
    assert run["end"] < 5
    calibrate = ["calibrate", "slow.toml", "--out", "rates.toml", "--runs", 2, "--duration", 5]
    done = wellmixed_here(*calibrate, cwd=tmp_path)
    assert done.code == 2
    assert "no calibration run reached its end" in done.err
    assert not (tmp_path / "rates.toml").exists()


def test_export(wellmixed, place, simulated):
    done = wellmixed("runs", "export", "runs", "--out", "tables", "--json", cwd=place)
    assert done.err == ""
    assert sorted(Path(name).name for name in done.json["written"]) == [
        f"{name}.{kind}" for name in ("events", "runs", "settings") for kind in ("csv", "parquet")
    ]
    for name in ("runs", "events", "settings"):
        parquet, csv = pd.read_parquet(place / f"tables/{name}.parquet"), pd.read_csv(place / f"tables/{name}.csv")
        assert list(parquet) == list(csv)
        assert len(parquet) == len(csv)
    runs, events = (pd.read_parquet(place / f"tables/{name}.parquet") for name in ("runs", "events"))
    rows = {run["key"]: run for run in simulated.json["runs"]}
    assert set(rows) <= set(runs["run"])
    for key, run in rows.items():
        assert (events["run"] == key).sum() == sum(run["events"].values())


def test_demo(place, demonstrated):
    assert demonstrated.err == ""
    data = demonstrated.json
    assert [row["channel"] for row in data["channels"]] == CHANNELS
    assert [row["label"] for row in data["summary"]] == ["60 cubes", "80 cubes", "120 cubes"]
    report = (place / data["report"]).read_text(encoding="utf-8")
    assert (place / data["rates"]).is_file()
    for row in data["channels"]:
        assert row["channel"].replace(">", "&gt;") in report
    assert report.count("<img") >= 5
    for reference in ("http://", "https://", "<script", "<link"):  # self-contained
        assert reference not in report
    names = re.findall(r"<th>(.*?)</th>", report) + re.findall(r"<tr><td>(.*?)</td>", report.partition("Provenance")[0])
    assert len(names) > 60
    shortened = {"low", "high", "aic", "came", "freedom", "crps", "sd", "n"}
    assert [name for name in names if "_" in name or name.lower() in shortened] == []


def test_calibrate(place, calibrated):
    assert calibrated.err == ""
    data = calibrated.json
    assert [row["channel"] for row in data["channels"]] == CHANNELS
    assert [row["ways"] for row in data["channels"]] == [4, 4, 4, 4, 1, 2, 2, 1]
    measured = [row for row in data["channels"] if row["channel"] not in data["not_measured"]]
    assert len(measured) >= 6  # quadmers may not come up in such short runs
    for row in measured:
        assert 0 <= row["low"] <= row["rate"] <= row["high"]
        assert row["rate"] == pytest.approx(row["events"] / row["exposure"])
    assert all((row["exposure"], row["rate"]) == (0, None) for row in data["channels"] if row not in measured)
    assert data["problems"] == []
    rates = tomllib.loads((place / "rates.toml").read_text(encoding="utf-8"))
    assert rates["convention"]["combinations"] == "distinct"
    assert {"cubes": [60], "runs": 10, "duration": 18.0, "seed": data["seed"]}.items() <= rates["evidence"].items()
    assert data["seed"] == 1
    assert {name: channel["events"] for name, channel in rates["channels"].items()} == {
        row["channel"]: row["events"] for row in data["channels"]
    }
    diagnostics = data["diagnostics"]
    assert [row["test"] for row in diagnostics["by_test"]] == [test.name for test in DIAGNOSTICS]
    assert diagnostics["doubtful"] == rates["evidence"]["doubtful_tests"]
    report = (place / "calibration.html").read_text(encoding="utf-8")
    assert "Rates of line4" in report
    assert data["not_seen"] == [row["channel"] for row in measured if row["events"] == 0] != []
    assert html.escape(f"Not seen: {', '.join(data['not_seen'])}. ") in report
    for words in (diagnostics["verdict"], *(row["verdict"] for row in diagnostics["by_test"])):
        assert html.escape(words) in re.sub("</?span>", "", report)  # around what a line may not break


def test_calibrate_again_writes_the_same_rates(wellmixed_here, place, demonstrated, calibrated):
    before = (place / "rates.toml").read_bytes()
    assert before == (place / demonstrated.json["rates"]).read_bytes()
    done = wellmixed_here(*CALIBRATE, "--out", "rates.toml", "--workers", 2, cwd=place)
    assert (done.code, done.err) == (0, "")
    assert f"\nNot seen: {', '.join(calibrated.json['not_seen'])}. For a rate" in done.out
    assert done.out.splitlines()[-1] == "rates written to rates.toml"
    assert (place / "rates.toml").read_bytes() == before


def test_validate(wellmixed, wellmixed_here, place, demonstrated, calibrated):
    options = ["--cubes", 60, 80, "--report", "validation.html", "--json"]
    done = wellmixed(*VALIDATE, "--rates", "rates.toml", *options, cwd=place)
    assert done.err == ""
    data = done.json
    assert [each["summary"]["label"] for each in data["comparisons"]] == ["60 cubes", "80 cubes"]
    for each in data["comparisons"]:
        assert {"coverage", "crps", "first_predicted", "cpu_mechanics_s", "cpu_ssa_s"} <= set(each["summary"])
        assert each["species"] == SPECIES
        assert len(each["table"]) == 41 * 4
    report = (place / "validation.html").read_text(encoding="utf-8")
    assert "Predicted against simulated" in report
    diagnostics = data["diagnostics"]
    assert [row["test"] for row in diagnostics["by_test"]] == [test.name for test in DIAGNOSTICS]
    assert "same pieces" in {row["variant"].split(", ")[-1] for row in diagnostics["results"]}
    for words in (diagnostics["verdict"], *(row["verdict"] for row in diagnostics["by_test"])):
        assert html.escape(words) in re.sub("</?span>", "", report)  # around what a line may not break
    for each, shown in zip(data["comparisons"], demonstrated.json["summary"][:2], strict=True):
        assert {"crps": shown["crps"], "coverage": shown["coverage"]}.items() <= each["summary"].items()
    again = wellmixed_here(*VALIDATE, "--rates", "rates.toml", "--cubes", 60, cwd=place)
    assert (again.code, again.err) == (0, "")
    assert [line.split()[0] for line in again.out.splitlines()[:2]] == ["size", "60"]
    assert any(line.startswith(("No sign against", "The model is doubtful")) for line in again.out.splitlines())


@pytest.mark.parametrize("rates", ["table3", "rates.toml"])
@pytest.mark.parametrize("method", ["ssa", "transient"])
def test_predict(wellmixed_here, place, calibrated, rates, method):
    start = ["predict", "line4", "--rates", rates, "--cubes", 60, "--method", method]
    command = [*start, "--times", 10, 50, 100, "--json"]
    done = wellmixed_here(*command, "--seed", 3, cwd=place)
    assert done.err == ""
    data = done.json
    assert data["times"] == [10, 50, 100]
    assert data["species"] == SPECIES
    for table in (data["mean"], data["sd"]):
        assert [len(row) for row in table] == [4, 4, 4]
    for row in data["mean"]:
        assert sum(value * (i + 1) for i, value in enumerate(row)) == pytest.approx(60)
    assert (data["interval"] is not None) == (rates == "rates.toml")
    other = wellmixed_here(*command, "--seed", 4, cwd=place).json
    assert (other["mean"] == data["mean"]) == (method == "transient")


@pytest.mark.parametrize(
    "command",
    [
        ["predict", "line4", "--cubes", 60, "--times", 10, 50, "--seed", 3],
        ["passage", "line4", "--cubes", 60, "--species", "dimer"],
    ],
    ids=["predict", "passage"],
)
def test_predictions_are_the_same_in_another_process(wellmixed, wellmixed_here, place, calibrated, command):
    there = wellmixed(*command, "--rates", "rates.toml", "--json", cwd=place)
    assert there.err == ""
    here = wellmixed_here(*command, "--rates", "rates.toml", "--json", cwd=place).json
    assert free(there.json) == free(here)


def free(content):
    """JSON content without what it cost."""
    if isinstance(content, list):
        return [free(each) for each in content]
    return {k: free(v) for k, v in content.items() if k != "cpu_seconds"} if isinstance(content, dict) else content


@pytest.mark.parametrize(("rates", "species"), [("table3", "quadmer"), ("rates.toml", "dimer")])
def test_passage(wellmixed_here, place, calibrated, rates, species):
    command = ["passage", "line4", "--rates", rates, "--cubes", 60, "--species", species, "--json"]
    done = wellmixed_here(*command, cwd=place)
    assert done.err == ""
    data = done.json
    waits = [each["value"] for each in data["quantiles"].values()]
    assert list(data["quantiles"]) == ["0.025", "0.25", "0.5", "0.75", "0.975"]
    assert waits == sorted(waits)
    assert waits[0] < data["mean"]["value"] < waits[-1]
    assert data["sd"]["value"] > 0
    assert data["mean"]["kind"] == ("95 % confidence" if rates == "rates.toml" else "proven")


def test_derive(wellmixed, tmp_path):
    data = wellmixed("rules", "derive", "line4", "--json", cwd=tmp_path).json
    assert data["species"] == SPECIES
    assert [row["name"] for row in data["channels"]] == CHANNELS


def test_a_mistake_is_one_line_and_exit_code_2(wellmixed, tmp_path):
    done = wellmixed("rules", "derive", "nobook", cwd=tmp_path)
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("Error: unknown rule book 'nobook'; shipped are jack13, line4")
    assert done.err.count("\n") == 1


@pytest.fixture(scope="module")
def posed(wellmixed_here, place):
    """The file of a short run with poses."""
    tank = ["simulate", "line4", "--cubes", 6, "--duration", 0.2, "--poses", 0.1, "--runs-folder", "posed", "--json"]
    (run,) = wellmixed_here(*tank, cwd=place).json["runs"]
    return f"posed/{run['key']}.run"


@pytest.mark.parametrize(
    "command",
    [
        "runs render POSED --out strip.png",
        "runs replay POSED",
        "rules draw t5 --out t5.png",
        "rules check line4",
        "trust accuracy kinetics line4 --rates table3 --cubes 4 --duration 10 --budget 1e-9",
        "study first-times number --points number=40 --collect --runs-folder posed",
    ],
)
def test_what_is_tested_elsewhere_in_one_process_works_as_installed(wellmixed, place, posed, command):
    """The tests of the rooms check the results."""
    done = wellmixed(*command.replace("POSED", posed).split(), "--json", cwd=place)
    assert isinstance(done.json, dict)


LONG = ["simulate", "line4", "--cubes", 20, "--duration", 3, "--runs", 3, "--seed", 1, "--workers", 2, "--json"]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The digest that the long command gives when nobody disturbs it."""
    return run_here(*LONG, cwd=tmp_path_factory.mktemp("undisturbed")).json["digest"]


@contextmanager
def at_work(place):
    """The long command in a process, its first run finished. It cannot end, for its last run is claimed by the test."""
    claim = RunStore(place / "runs").claim(RunSpec(Scene.load("line4"), {"monomer": 20}, 3.0, seed=1, run=2))
    command = [str(COMMAND), *map(str, LONG)]
    process = subprocess.Popen(command, cwd=place, stdout=-1, stderr=-1, text=True, start_new_session=True)
    try:
        while not list(place.glob("runs/*.run")):
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)
        yield process
    finally:
        process.kill()
        process.communicate()
        claim.release()


def check_that_it_goes_on(place, digest):
    kept = len(list(place.glob("runs/*.run")))
    assert 1 <= kept < 3
    done = run_here(*LONG, cwd=place)
    assert done.err == ""
    assert (done.json["reused"], done.json["computed"]) == (kept, 3 - kept)
    assert done.json["digest"] == digest


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_and_sigterm(tmp_path, undisturbed, number):
    with at_work(tmp_path) as process:
        os.killpg(process.pid, number)  # a terminal, or a machine that is shut down, sends it to all processes
        out, err = process.communicate()  # returns once the workers are gone too, for they hold the same pipes
    assert process.returncode == 130
    assert out == ""
    assert told(err) == ("Interrupted: finished runs are kept in runs; the same command makes only the missing ones.\n")
    check_that_it_goes_on(tmp_path, undisturbed)


def test_kill_9(tmp_path, undisturbed):
    with at_work(tmp_path) as process:
        process.kill()
        process.communicate()  # returns once the workers are gone too, for they hold the same pipes
    check_that_it_goes_on(tmp_path, undisturbed)
