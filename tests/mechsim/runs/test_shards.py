"""Shards of a command, and the options that say who makes which runs."""

import json
import shutil
import subprocess
import sys

import pytest
from command_line import run_here
from fake_runs import execute, record_of, specs_of

from mechsim.runs.ensemble import run_all
from mechsim.runs.executors import EXECUTORS, Processes
from mechsim.runs.shards import Shard, missing
from mechsim.runs.store import RunStore, digest_of

SIMULATE = ["simulate", "line4", "--cubes", 6, "--duration", 1, "--runs", 5, "--seed", 1]
CALIBRATE = ["calibrate", "line4", "--cubes", 6, 8, "--runs", 2, "--duration", 1, "--out", "rates.toml"]
VALIDATE = ["validate", "line4", "--rates", "table3", "--cubes", 6, 8, "--runs", 2, "--duration", 1]


@pytest.mark.parametrize("count", [1, 2, 3, 7, 12])
def test_shards_share_the_runs_out(count):
    specs = specs_of(10)
    shards = [Shard(index, count).of(specs) for index in range(1, count + 1)]
    assert sorted((spec for shard in shards for spec in shard), key=lambda spec: spec.run) == specs
    assert max(map(len, shards)) - min(map(len, shards)) <= 1
    for before, after in zip(shards, (Shard(i, count).of(specs_of(13)) for i in range(1, count + 1)), strict=True):
        assert after[: len(before)] == before  # a run keeps its shard when more are asked for


@pytest.mark.parametrize("text", ["9/8", "0/8", "3", "3/", "/8", "a/b", "-1/8", "1.5/8", "3/8/2", "", "²/8", "0/0"])
def test_what_is_no_shard(text):
    with pytest.raises(ValueError, match=r"expected K/N with K from 1 to N, as in 3/8"):
        Shard.parse(text)
    assert Shard.parse("3/8") == Shard(3, 8)


def test_shards_in_folders_of_their_own_are_merged_by_copying(tmp_path):
    specs, whole = specs_of(8), tmp_path / "whole"
    RunStore(whole)
    for index in (1, 2, 3):
        store = RunStore(tmp_path / str(index))
        mine = Shard(index, 3).of(specs)
        assert missing(specs, whole) == [spec for spec in specs if (spec.run % 3) + 1 >= index]
        assert run_all(mine, store, execute=execute).digest == digest_of(map(record_of, mine))
        for path in store.folder.glob("*.run"):
            shutil.copy(path, whole)
    assert missing(specs, whole) == []
    assert RunStore(whole).digest(specs) == digest_of(map(record_of, specs))
    assert missing(specs, tmp_path / "nowhere") == specs
    assert not (tmp_path / "nowhere").exists()


def test_a_damaged_run_is_missing(tmp_path):
    store, specs = RunStore(tmp_path), specs_of(2)
    for spec in specs:
        store.write(record_of(spec))
    store.path(specs[1]).write_bytes(b"?")
    with pytest.warns(RuntimeWarning, match="damaged"):
        assert missing(specs, tmp_path) == specs[1:]


def test_shards_of_a_command(tmp_path):
    listed = run_here(*SIMULATE, "--missing", "--json", cwd=tmp_path)
    assert listed.code == 4
    rows = json.loads(listed.out)["missing"]
    assert len(rows) == json.loads(listed.out)["runs"] == 5
    assert list(tmp_path.iterdir()) == []
    done = [run_here(*SIMULATE, "--shard", f"{k}/2", "--json", cwd=tmp_path) for k in (1, 2)]
    assert [(one.json["shard"], one.json["computed"]) for one in done] == [("1/2", 3), ("2/2", 2)]
    assert {path.stem for path in (tmp_path / "runs").glob("*.run")} == {row["key"] for row in rows}
    (tmp_path / "runs" / f"{rows[1]['key']}.run").unlink()
    left = run_here(*SIMULATE, "--missing", cwd=tmp_path)
    assert left.code == 4
    assert left.out == f"missing: {rows[1]['run']}\n4 of 5 runs are in runs\n"
    assert run_here(*SIMULATE, "--missing", "--shard", "1/2", cwd=tmp_path).code == 0
    again = run_here(*SIMULATE, "--shard", "2/2", cwd=tmp_path)
    assert again.code == 0
    assert again.out.startswith("shard 2/2: 1 runs made, 1 found; digest ")
    whole = run_here(*SIMULATE, "--json", cwd=tmp_path).json  # finds what the shards have made
    assert (whole["computed"], whole["reused"]) == (0, 5)
    alone = run_here(*SIMULATE, "--runs-folder", "alone", "--json", cwd=tmp_path).json
    assert whole["digest"] == alone["digest"]


@pytest.mark.parametrize("command", [CALIBRATE, VALIDATE], ids=["rates", "held-out"])
def test_other_commands_share_their_runs_out_alike(tmp_path, command):
    """One run each: how shards are made and merged is the same code."""
    rows = json.loads(run_here(*command, "--missing", "--json", cwd=tmp_path).out)["missing"]
    assert len(rows) > 2
    one = run_here(*command, "--shard", f"2/{len(rows)}", "--json", cwd=tmp_path)
    assert one.json["computed"] == 1
    assert not (tmp_path / "rates.toml").exists()  # results are for the whole
    assert [path.stem for path in (tmp_path / "runs").glob("*.run")] == [rows[1]["key"]]
    left = run_here(*command, "--missing", "--json", cwd=tmp_path)
    assert left.code == 4
    assert json.loads(left.out)["missing"] == [rows[0], *rows[2:]]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--shard", "9/8"], "shard 9/8; expected K/N with K from 1 to N, as in 3/8"),
        (["--shard", "1/2", "--cost-profile"], "--cost-profile makes no runs: leave out --shard and --missing"),
        (
            ["--workers", 2, "--scheduler", "tcp://127.0.0.1:1"],
            "--workers and --scheduler both say what makes the runs",
        ),
        (["--timeout", 0], "0.0 is not in the range x>0"),
        (["--timeout", "nan"], "timeout = nan; expected seconds above 0, or none"),
        (["--scheduler", "tcp://127.0.0.1:1"], "no Dask scheduler answers at 'tcp://127.0.0.1:1': "),
    ],
)
def test_mistakes_make_nothing(tmp_path, options, said):
    if "--scheduler" in options:
        pytest.importorskip("distributed")
    done = run_here(*SIMULATE, *options, cwd=tmp_path)
    assert (done.code, done.out) == (3 if "no Dask scheduler" in said else 2, "")
    assert said in done.err
    assert done.err.count("Error: ") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_first_executor_is_the_default():
    assert EXECUTORS[0] is Processes
    assert Processes.from_option(None, timeout=9.0) == Processes(1, 9.0)


def in_python(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


def test_without_dask():
    """Nothing needs it but --scheduler, which says what to install."""
    without = "import sys; sys.modules['distributed'] = sys.modules['dask'] = None\n"
    rooms = "import mechsim.runs.ensemble, mechsim.commands.options, calibration.commands.calibrate"
    assert in_python(without + rooms).returncode == 0
    done = in_python(f"{without}from wellmixed import main; main({[*map(str, SIMULATE), '--scheduler', 'a:1']})")
    assert done.returncode == 2
    assert done.stderr == "Error: this needs distributed; install it by: pip install 'distributed>=2026.8'\n"
