"""`wellmixed scan`: tables, files, Ctrl-C, and mistakes."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from command_line import COMMAND, run_here
from failing_disk import FailingDisk, fail_here

MODEL = "bind: A + B -> AB, k1\nunbind: AB -> A + B, k2\nk1 = 1e-3\nk2 = 0.1\nA = 20\nB = 10\n"
LINE = ["scan", "line4", "--rates", "table3"]
ASK = ["--ask", "E[AB] @ 100", "--ask", "P=? [F<=100 AB>=5]"]


@pytest.fixture
def place(tmp_path):
    (tmp_path / "model.rxn").write_text(MODEL, encoding="utf-8")
    return tmp_path


def test_a_network_file(place):
    command = ["scan", "model.rxn", "--over", "k1=1e-4:1e-2:3log", "--over", "B=5,10", *ASK, "--json"]
    files = ["--csv", "a.csv", "--parquet", "a.parquet", "--plot", "a.png", "--html", "a.html"]
    done = run_here(*command, *files, cwd=place)
    data = done.json
    assert data["over"] == {"k1": pytest.approx([1e-4, 1e-3, 1e-2]), "B": [5.0, 10.0]}
    assert (data["points"], data["complete"], len(data["rows"])) == (6, True, 12)
    assert {row["kind"] for row in data["rows"]} == {"proven"}
    asked = run_here("ask", "model.rxn", "--set", "k1=1e-3", "--initial", "B=5", ASK[1], ASK[3], "--json", cwd=place)
    rows = [row for row in data["rows"] if row["k1"] == pytest.approx(1e-3) and row["B"] == 5]
    for row, answer in zip(rows, asked.json["answers"], strict=True):
        assert row["low"] <= answer["high"]
        assert answer["low"] <= row["high"]
        assert row["value"] == pytest.approx(answer["value"], rel=1e-12)
    assert (place / "a.png").read_bytes().startswith(b"\x89PNG")
    page = (place / "a.html").read_text(encoding="utf-8")
    assert all(name in page for name in ("k1, rate constant of channel bind", "B at time 0 (count)", *ASK[1::2][:1]))
    table = pd.read_parquet(place / "a.parquet")
    assert table["value"].tolist() == pd.read_csv(place / "a.csv")["value"].tolist()
    assert table["value"].tolist() == [row["value"] for row in data["rows"]]
    again = run_here(*command, cwd=place)
    assert again.json["rows"] == data["rows"]  # seconds too: they were kept


def test_a_book_over_cubes(place):
    done = run_here(*LINE, "--over", "cubes=6,8", "--ask", "E[quadmer] @ 500", cwd=place)
    assert done.code == 0, done.err
    assert "2 points of cubes (2), 1 question: 2 proven" in done.out
    assert "breaks: first-order; tank 2 x 2 x 3" in done.out
    one = run_here("ask", "line4", "--rates", "table3", "--cubes", 8, 'R{"quadmer"}=? [ I=500 ]', "--json", cwd=place)
    assert f"{one.json['answers'][0]['value']:.6g}" in done.out


def test_a_book_over_a_rate_constant(place):
    settings = ["--cubes", 6, "--over", "1+1->2=1e-4,1e-3", "--ask", "E[monomer] @ 100", "--json"]
    rows = run_here(*LINE, *settings, cwd=place).json["rows"]
    assert rows[0]["value"] > rows[1]["value"]


def test_sampled_by_workers(place):
    command = ["scan", "model.rxn", "--over", "k1=1e-3,1e-2", "--over", "B=5,9", *ASK, "--max-states", 0, "--json"]
    more = ["--runs", 40, "--seed", 3]
    once = run_here(*command, *more, "--scans-folder", "a", cwd=place).json
    done = subprocess.run(
        [str(COMMAND), *map(str, [*command, *more, "--workers", 2, "--scans-folder", "b"])],
        cwd=place, capture_output=True, text=True, check=True,
    )  # fmt: skip
    twice = json.loads(done.stdout)
    for one, other in zip(once["rows"], twice["rows"], strict=True):
        assert one | {"cpu_seconds": 0} == other | {"cpu_seconds": 0}
    assert {row["kind"] for row in once["rows"]} == {"95 % confidence"}


SLOW = [
    *("scan", "model.rxn", "--set", "k2=5.0", "--over", "k1=0.1:0.3:12", "--over", "A=200", "--max-states", "0"),
    *("--ask", "P=? [F<=2 AB>=250]", "--runs", "150"),
]


@pytest.mark.parametrize(
    ("workers", "number"),
    [
        pytest.param(1, signal.SIGINT, marks=pytest.mark.validate),
        (2, signal.SIGINT),
        pytest.param(2, signal.SIGTERM, marks=pytest.mark.validate),
    ],
)
def test_ctrl_c_keeps_what_is_done_and_the_same_command_goes_on(place, workers, number):
    """The signal comes once three points are on disk; a scan that is done by then would be no test, and fails it."""
    (place / "model.rxn").write_text(MODEL.replace("B = 10", "B = 200"), encoding="utf-8")
    command = [sys.executable, "-m", "wellmixed", *SLOW, "--workers", str(workers)]
    here = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[3]), *sys.path])}
    process = subprocess.Popen(
        command, cwd=place, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, env=here
    )
    while process.poll() is None and lines(place) < 3:
        time.sleep(0.01)
    os.killpg(process.pid, number)
    out, err = process.communicate()
    assert process.returncode == 130, err
    made = lines(place)
    assert 3 <= made < 12
    assert f"Interrupted: {made} of 12 points are answered and stored in scans; the same command continues" in err
    assert "Traceback" not in err
    assert f"{made} of 12 points of k1 (12) x A (1)" in out
    done = run_here(*SLOW, "--runs", 150, "--json", cwd=place)
    assert done.json["complete"]
    assert lines(place) == 12  # those that were done are not made again


def lines(place):
    """Whole lines of the files of scans."""
    return sum(path.read_bytes().count(b"\n") for path in (place / "scans").glob("*.jsonl"))


@pytest.mark.parametrize("piece", [1 << 30, pytest.param(100, marks=pytest.mark.validate)])
def test_a_disk_that_fails_at_the_nth_call_loses_no_point_and_no_table(place, monkeypatch, piece):
    command = ["scan", "model.rxn", "--over", "k1=1e-3,1e-2,1e-1", *ASK, "--max-states", 0, "--runs", 5]
    command += ["--csv", "a.csv"]
    right = run_here(*command, "--scans-folder", "right", cwd=place)
    table = pd.read_csv(place / "a.csv").drop(columns="cpu_seconds")
    for at in range(1, 200):
        (place / "a.csv").write_bytes(b"older")
        disk = FailingDisk(at, piece=piece)
        with fail_here(monkeypatch, disk):
            done = run_here(*command, "--scans-folder", str(at), cwd=place)
        if len(disk.calls) < at:
            break
        assert done.code == 3
        assert (place / "a.csv").read_bytes() == b"older"
        again = run_here(*command, "--scans-folder", str(at), cwd=place)
        assert again.code == right.code == 0
        pd.testing.assert_frame_equal(pd.read_csv(place / "a.csv").drop(columns="cpu_seconds"), table)
    assert at > 3 * 3 + 4


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--over", "k3=1,2", *ASK], "'k3' is no parameter, species or channel of the model; did you mean"),
        (["--over", "k1=1e-4:0:5log", *ASK], "both ends of a log range are above 0"),
        (["--over", "k1=", *ASK], "names no values"),
        (["--over", "k1=1,inf", *ASK], "inf is not finite"),
        (["--over", "k1=1:2:9999", "--over", "k2=1:2:9999", *ASK], "at most 100000 are scanned"),
        (["--over", "k1=1", "--over", "k1=2", *ASK], "--over k1 came twice"),
        (["--over", "k1=1,2", "--set", "k1=3", *ASK], "--set k1 and --over k1: a name is set, or scanned"),
        (["--over", "k1=1", "--ask", "E[AB]"], "cannot read the question 'E[AB]'"),
        (["--over", "k1=1", "--ask", "E[AX] @ 1"], "unknown reward 'AX'"),
        (["--over", "A=1.5", *ASK], "must be whole numbers; 1.5 is not one"),
        (["--over", "k1=1"], "Missing option '--ask'"),
        (ASK, "Missing option '--over'"),
        (["--over", "k1=1", *ASK, "--runs", 1], "is not in the range x>=2"),
        (["--over", "k1=1", *ASK, "--plot", "a.gif"], "must end in .png, .pdf, .svg"),
        (["--over", "k1=1", *ASK, "--scans-folder", "model.rxn"], "is a file"),
        (["--over", "cubes=1", *ASK], "'cubes' is no parameter"),
    ],
)
def test_mistakes(place, arguments, said):
    done = run_here("scan", "model.rxn", *arguments, cwd=place)
    assert (done.code, done.out) == (2, "")
    assert said in done.err
    assert not (place / "scans").exists() or not list((place / "scans").iterdir())


def test_a_point_without_an_answer_ends_with_code_1(place):
    done = run_here("scan", "model.rxn", "--over", "A=2,6", "--ask", 'R{"time"}=? [ F AB >= 4 ]', cwd=place)
    assert done.code == 1
    assert "2 points of A (2), 1 question: 1 proven, 1 without an answer" in done.out
    assert "none: the target is reached with probability 0 only" in done.out


def test_a_scheduler_that_is_not_there(place):
    arguments = ["scan", "model.rxn", "--over", "k1=1,2", *ASK, "--scheduler", "nowhere"]
    done = run_here(*arguments, cwd=place)
    assert done.code in (2, 3)
    assert "no Dask scheduler answers at 'nowhere'" in done.err
