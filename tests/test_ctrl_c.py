"""Ctrl-C and SIGTERM at any moment end any command within a second, and it says what is kept.

A second of processor time, for the machine may be busy; its exit code says that it was interrupted, nothing looks like
a fault, and no part of a file is left.
"""

import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import COMMAND

from kinetics.predicting.methods import names
from kinetics.sampling.methods import BY_NAME as SAMPLING

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads processor time from /proc")
ALLOWED = 1.5  # s of processor time after the signal, in which a process also ends
PATIENCE = 60.0  # s of the clock
TRIES, FEW = 100, 8
TICK = os.sysconf("SC_CLK_TCK")

# Every line of work below takes minutes.
FILES = {
    "loop.rxn": "A <-> B, 1.3, 1\nB <-> C, 1, 0.7\nC <-> D, 1, 0.4\nA + B -> C + D, 0.001\nA = 100",  # 176,851 states
    "stiff.rxn": "A <-> B, 1000, 2000\nB <-> C, 1, 0.7\nC <-> D, 0.001, 0.004\nA = 40",  # 12,341
    "pair.rxn": "A <-> B, 1.3, 1\nB <-> C, 1, 0.7\nA = 60",  # 1,891
    "open.rxn": "0 -> A, 500\n0 -> B, 400\nA -> 0, 1\nB -> 0, 0.5\nA + B -> 0, 0.0001",
    "cycle.rxn": "X -> 2 X, 1\nX + Y -> 2 Y, 0.005\nY -> 0, 0.6\nX = 100\nY = 100",
    "law.rxn": "0 -> A, 500\nA -> 0, 1.0 * A / (1 + 0.001 * A)\n0 -> B, 5\nB -> 0, 1",
}
SOLVED = {"transient": "loop", "dense": "pair", "collocation": "stiff", "fsp": "open", "matrix-free": "open"}
WORK = {f"predict {name}": ["predict", f"{SOLVED[name]}.rxn", "--method", name, "--times", "10000"] for name in SOLVED}
WORK["predict mean-field"] = ["predict", "cycle.rxn", "--method", "mean-field", "--times", "1e9"]
WORK |= {
    f"predict {name}": [
        *("predict", f"{'law' if name == 'general' else 'open'}.rxn", "--method", name, "--times", "5e4"),
        *("--budget", "1e5"),
    ]
    for name in SAMPLING
}
WORK |= {
    "predict --accuracy": ["predict", "loop.rxn", "--times", "1000", "--accuracy", "0.001%"],
    "passage --sensitivity": ["passage", "stiff.rxn", "--species", "D", "--copies", "30", "--sensitivity"],
    "ask F<=": ["ask", "loop.rxn", "P=? [ F<=10000 D >= 95 ]"],
    "ask S": ["ask", "loop.rxn", "S=? [ D >= 95 ]"],
    "ask C<=": ["ask", "loop.rxn", 'R{"D"}=? [ C<=10000 ]'],
    "ask E": ["ask", "loop.rxn", "E[D] @ 100000"],
    "ask --sensitivity": ["ask", "loop.rxn", "E[D] @ 1000", "--sensitivity"],
    "ask --out": ["ask", "loop.rxn", "S=? [ D >= 95 ]", "--out", "chain.tra"],
    "scan": [
        *("scan", "loop.rxn", "--ask", "E[D] @ 10000", "--over", "A=99,100", "--max-states", "1000000"),
        *("--workers", "2", "--csv", "table.csv"),
    ],
    "scan, sampled": ["scan", "open.rxn", "--ask", "E[A] @ 1000", "--over", "A=0,1", "--runs", "50000"],
    "grow": ["rules", "grow", "pyramid45", "--cubes", "50000", "--join", "1e-7", "--runs", "1000"],
    "rules compile": ["rules", "compile", "pyramid45", "--out", "book.toml"],
    "rules check": ["rules", "check", "pyramid45", "--json"],
    "verify": ["trust", "verify", "pair.rxn", "--runs", "50000", "--budget", "1e5"],
    "hardcases": ["trust", "hardcases"],
    "accuracy": ["trust", "accuracy", "kinetics", "pair.rxn", "--csv", "table.csv"],
}
OUTPUTS = ("table.csv", "book.toml")
FROM = {"rules check": 3.0, "ask --out": 1.0}  # s of processor time until the work that is meant


def test_every_method_is_among_the_work():
    assert {f"predict {name}" for name in names()} <= WORK.keys()


def drawn(count, work):
    rng = np.random.default_rng(28)
    rounds = (rng.permutation(sorted(work)) for _ in range(-(-count // len(work))))
    made = [(str(name), rng.uniform(), k % 2) for some in rounds for k, name in enumerate(some)]
    return [(name, (0.5 if i < FEW else 2.5) * later, which) for i, (name, later, which) in enumerate(made[:count])]


SIGNALS = [signal.SIGINT, signal.SIGTERM]
CASES = drawn(TRIES, WORK)


def processor_time(pid):
    """Of a process, s; None where it has ended."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return None if fields[0] == "Z" else (int(fields[11]) + int(fields[12])) / TICK


def wait_until(process, reached):
    began = time.monotonic()
    while (now := processor_time(process.pid)) is not None and now < reached and time.monotonic() - began < PATIENCE:
        time.sleep(0.01)
    return now


@pytest.fixture(scope="module")
def start_up():
    """Processor time until a command is at work, s."""
    before = os.times()
    subprocess.run([COMMAND, "rules", "derive", "line4", "--json"], check=True, capture_output=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


@pytest.mark.parametrize(
    ("name", "later", "which"),
    [pytest.param(*case, marks=() if i < FEW else pytest.mark.validate) for i, case in enumerate(CASES)],
)
def test_work_ends_within_a_second(name, later, which, start_up, tmp_path):
    for file, text in FILES.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    with (tmp_path / "out").open("w") as out, (tmp_path / "err").open("w") as err:
        process = subprocess.Popen(
            [COMMAND, *WORK[name]], cwd=tmp_path, stdout=out, stderr=err, start_new_session=True,
        )  # fmt: skip
        try:
            used = wait_until(process, start_up + FROM.get(name, 0.0) + later)
            told = (tmp_path / "err").read_text(encoding="utf-8")
            assert used is not None, f"it ended before it was interrupted: {told}"
            os.killpg(process.pid, SIGNALS[which % len(SIGNALS)])
            began = time.monotonic()
            while not (ended := os.wait4(process.pid, os.WNOHANG))[0]:
                assert time.monotonic() - began < PATIENCE, (tmp_path / "err").read_text(encoding="utf-8")
                time.sleep(0.01)
            process.returncode = os.waitstatus_to_exitcode(ended[1])
        finally:
            if process.returncode is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
    told = (tmp_path / "err").read_text(encoding="utf-8") + (tmp_path / "out").read_text(encoding="utf-8")
    assert process.returncode == 130, told
    assert ended[2].ru_utime + ended[2].ru_stime - used < ALLOWED
    assert "nterrupted" in told or "Ctrl-C" in told
    assert "Traceback" not in told
    assert not [name for name in OUTPUTS if (tmp_path / name).exists()]
    if (tmp_path / "chain.tra").exists():  # written before the question is answered, and whole
        first, *lines = (tmp_path / "chain.tra").read_text(encoding="utf-8").splitlines()
        assert len(lines) == int(first.split()[1])
    assert not [path for path in tmp_path.rglob("*") if "tmp" in path.name or path.name.startswith(".")]
