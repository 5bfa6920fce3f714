"""Standard output and error may be full, closed or without a reader: codes are as documented, files whole."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import COMMAND, run
from forked_commands import STATES, WELL, table

from kinetics.support.cli.failures import BROKEN_PIPE, CHECKED, MISTAKE, OUTSIDE

PREDICT = ["predict", "line4", "--rates", "table3", "--cubes", "6", "--runs", "5", "--duration", "1"]
SIMULATE = ["simulate", "line4", "--cubes", "2", "--duration", "0.1", "--runs-folder"]
# what is typed, and its exit code where all is well
COMMANDS = {
    "help": (["--help"], 0),
    "version": (["--version"], 0),
    "derive": (["rules", "derive", "line4"], 0),
    "derive into a file": (
        ["rules", "derive", "line4", "--rates", "table3", "--cubes", "9", "--out", "network.rxn"],
        0,
    ),
    "predict": (PREDICT, 0),
    "json": ([*PREDICT, "--json"], 0),
    "csv": ([*PREDICT, "--csv", "table.csv"], 0),
    "ask": (["ask", "line4", "--rates", "table3", "--cubes", "4", "P=? [ F quadmer>=1 ]"], 0),
    "rules check": (["rules", "check", "line4"], 0),
    "a check that finds errors": (["rules", "check", "line4_as_printed"], CHECKED),
    "simulate": ([*SIMULATE, "../../runs"], 0),
    "nothing": ([], MISTAKE),
    "no such command": (["prophesy"], MISTAKE),
    "an error of usage": (["predict", "--nothing"], MISTAKE),
    "an error of input": (["rules", "derive", "nowhere.net"], MISTAKE),
    "quiet": (["--quiet", "rules", "derive", "nowhere.net"], MISTAKE),
}
LOST = {
    "full": (OUTSIDE, "Error: could not write to standard output: No space left on device\n"),
    "closed": (OUTSIDE, "Error: could not write to standard output: it is closed\n"),
    "unread": (BROKEN_PIPE, ""),
}


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cells")
    assert run(*SIMULATE, folder / "runs", cwd=folder).code == 0
    return folder, table({command: words for command, (words, _) in COMMANDS.items()}, folder)


def read(place, ending):
    file = place.with_name(place.name + ending)
    text = file.read_text(encoding="utf-8") if file.exists() else ""
    return re.sub(r"[\d.e-]+( s CPU|}$)", "T", text)  # processor time


@pytest.mark.parametrize("command", COMMANDS)
def test_whatever_standard_streams_are_a_command_ends_as_documented(cells, command):
    folder, codes = cells
    usual, well = COMMANDS[command][1], folder / command / WELL
    for state, (out, err) in STATES.items():
        here = folder / command / state
        is_lost = out != "whole" and usual in (0, CHECKED)
        code, said = LOST[out] if is_lost else (usual, "")
        assert codes[command][state] == code, (state, read(here, ".err"))
        assert read(here, ".out") == (read(well, ".out") if out == "whole" else ""), state
        assert read(here, ".err") == (read(well, ".err") + said if err == "whole" else ""), state
        files = {file.name: file.stat().st_size for file in here.iterdir()}
        assert files == {file.name: file.stat().st_size for file in well.iterdir()}, state
    assert "Traceback" not in read(well, ".err")
    assert bool(read(well, ".out")) == (usual != MISTAKE)


def descriptor(state):
    if state == "unread":
        unread, opened = os.pipe()
        os.close(unread)
        return opened
    return os.open("/dev/full" if state == "full" else os.devnull, os.O_WRONLY)


@pytest.mark.parametrize(
    ("words", "unbuffered"), [(["--help"], ""), (["--help"], "1"), (["rules", "derive", "nowhere.net"], "")]
)
def test_processes_of_their_own_end_so_too(tmp_path, words, unbuffered):
    """What the table takes for granted: Python's start and end, with and without PYTHONUNBUFFERED."""
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    for state in map(STATES.get, ("output full", "output closed", "error closed", "both unread")):
        opened = [descriptor(each) for each in state]
        closed = [number for number, each in enumerate(state, 1) if each == "closed"]
        done = subprocess.run(
            [str(COMMAND), *words],
            cwd=tmp_path,
            env=environment,
            stdout=opened[0],
            stderr=opened[1],
            preexec_fn=lambda closed=closed: [os.close(number) for number in closed],
            check=False,
        )
        for each in opened:
            os.close(each)
        lost, _ = LOST.get(state[0], (0, ""))
        assert done.returncode == (lost if words == ["--help"] else MISTAKE), state


@pytest.mark.parametrize("way", [["-m", "wellmixed"], ["-c", "from wellmixed import main; main()"]])
def test_python_runs_the_command_with_the_same_end(tmp_path, way):
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, *way, "rules", "derive", "line4"]
        done = subprocess.run(command, cwd=tmp_path, stdout=full, stderr=-1, text=True, check=False)
    assert (done.returncode, done.stderr) == LOST["full"]


def test_letters_that_an_encoding_lacks_are_escaped(tmp_path):
    command = [str(COMMAND), *PREDICT]
    environment = {**os.environ, "PYTHONIOENCODING": "koi8-r"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "\\xb1" in done.stdout
