"""A million runs through the command, in one process of its own: memory, Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import COMMAND

RATES = Path(__file__).parents[3] / "results" / "line4" / "rates.toml"
PREDICT = [str(COMMAND), "predict", "line4", "--rates", str(RATES), "--cubes", "60", "--json"]
GB = 2**20  # in the kB that the system counts in


def finished(process):
    """Exit code, and the most memory it held, kB."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)  # it is gone: Popen must not wait for it again
    return process.returncode, usage.ru_maxrss


@pytest.mark.validate
@pytest.mark.skipif(sys.platform == "darwin", reason="counts memory in bytes there")
def test_a_million_runs_take_less_than_a_gigabyte(tmp_path):
    out = tmp_path / "out.json"
    with out.open("w") as file:
        process = subprocess.Popen([*PREDICT, "--runs", "1000000", "--method", "auto"], stdout=file)
        code, most = finished(process)
    data = json.loads(out.read_text(encoding="utf-8"))
    assert (code, data["runs"], len(data["times"]), data["complete"]) == (0, 10**6, 101, True)
    assert data["interval"] is not None
    assert most < GB


@pytest.mark.validate
@pytest.mark.skipif(sys.platform == "darwin", reason="counts memory in bytes there")
def test_the_counts_themselves_of_a_third_of_these_runs_take_more():
    # The control: `simulate` keeps them.
    keep = (
        "import numpy as np; from kinetics import Auto, simulate; "
        "from kinetics.commands.models import applied, described; "
        "from kinetics.support.cli.options import ModelOptions; "
        f"model = applied(*described(ModelOptions('line4', {str(RATES)!r}, 60))); "
        "simulate(model, Auto(), times=np.linspace(0, 2000, 101), runs=350_000)"
    )
    code, most = finished(subprocess.Popen([sys.executable, "-c", keep]))
    assert (code, most > GB) == (0, True)


@pytest.mark.validate
def test_ctrl_c_leaves_what_was_made(tmp_path):
    out = tmp_path / "out.json"
    with out.open("w") as file:
        process = subprocess.Popen([*PREDICT, "--runs", "500000000", "--times", "500", "2000"], stdout=file)
        time.sleep(20)
        process.send_signal(signal.SIGINT)
        code, _ = finished(process)
    data = json.loads(out.read_text(encoding="utf-8"))
    assert (code, data["complete"]) == (130, False)
    assert 0 < data["runs"] < 500_000_000
    assert any(note.startswith("interrupted: ") for note in data["notes"])
    assert max(map(max, data["standard_error"])) < 0.05
