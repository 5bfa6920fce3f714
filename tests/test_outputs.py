"""The files that commands write: through the door alone, whole or not at all, whatever the disk does."""

import os
import shutil
import sys
from pathlib import Path

import pytest
from command_line import run_here
from failing_disk import FailingDisk, fail_here

LINE4 = ["line4", "--rates", "table3", "--cubes", 6]
STUDY = """
name = "own"
title = "A study of $ and runs"
scene = "t5"
cubes = 10
runs = 1
cap = 0.5
typical = 0.4

[[factors]]
name = "number"
label = "cubes"
setting = "number"
levels = [8.0]
"""
# command, and the files it writes
COMMANDS = [
    (["predict", *LINE4, "--runs", 5, "--duration", 1, "--csv", "table.csv", "--plot", "plot.svg"], 2),
    (["predict", *LINE4, "--runs", 5, "--duration", 1, "--html", "page.html"], 1),
    (["passage", *LINE4, "--species", "dimer", "--plot", "plot.png"], 1),
    (["rules", "derive", *LINE4, "--out", "line.net"], 1),
    (["rules", "derive", *LINE4, "--out", "line.xml"], 1),
    (["ask", *LINE4, "--out", "line.tra"], 3),
    (["ask", *LINE4, "--out", "line.sm"], 1),
    (
        [
            "rules",
            "rank",
            "line4",
            "--rates",
            "table3",
            "--cubes",
            6,
            "--runs",
            5,
            "--best",
            "best.toml",
            "--csv",
            "ranks.csv",
        ],
        2,
    ),
    (["rules", "compile", "line4", "--out", "book.toml"], 1),
    (["rules", "draw", "line4", "--out", "rules.pdf"], 1),
    (["study", "first-times", "study.toml", "--collect", "--runs-folder", "posed", "--out", "found"], 1),
    (["runs", "export", "posed", "--out", "found"], 6),
    (["runs", "render", "RUN", "--runs-folder", "posed", "--out", "run.gif"], 1),
    (["runs", "render", "RUN", "--runs-folder", "posed", "--out", "run.png"], 1),
    (["runs", "render", "RUN", "--runs-folder", "posed", "--out", "run.html"], 1),
    (["runs", "replay", "RUN", "--poses", "last.npz"], 1),
]
IDS = [" ".join([str(word) for word in command if "." in str(word)] + [str(command[0])]) for command, _ in COMMANDS]


@pytest.fixture(scope="module")
def posed(tmp_path_factory):
    """A folder with a short run that has poses, and a study."""
    place = tmp_path_factory.mktemp("posed")
    tank = ["simulate", "t5", "--cubes", 8, "--duration", 0.05, "--poses", 0.02, "--runs-folder", "posed", "--json"]
    (run,) = run_here(*tank, cwd=place).json["runs"]
    (place / "study.toml").write_text(STUDY, encoding="utf-8")
    return place, f"posed/{run['key']}.run"


@pytest.fixture
def place(posed, tmp_path):
    """The same in a folder of its own, and the name of the run."""
    shutil.copytree(posed[0], tmp_path / "here")
    return tmp_path / "here", posed[1]


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def worded(command, run):
    return [run if word == "RUN" else word for word in command]


opened = []  # path and flags of each file opened for writing while a test watches
is_watching = False


def watch(event, arguments):
    if is_watching and event == "open" and isinstance(arguments[0], str | os.PathLike | bytes):
        path, _, flags = arguments
        if flags & (os.O_WRONLY | os.O_RDWR):
            opened.append((Path(os.fsdecode(path)).absolute(), flags))


sys.addaudithook(watch)  # for as long as the process lives; it does nothing unless a test watches


def opened_by(call, folder):
    """What `call` opens for writing in a folder, from this process."""
    global is_watching  # noqa: PLW0603 - a hook cannot be taken back
    opened.clear()
    is_watching = True
    try:
        call()
    finally:
        is_watching = False
    return [(path, flags) for path, flags in opened if path.is_relative_to(folder)]


def other_doors(found):
    """Of these, the names of those that are no temporary files of the door."""
    asked = os.O_EXCL | os.O_NOFOLLOW | os.O_CREAT
    return [path.name for path, flags in found if not (path.name.startswith(".wellmixed-") and flags & asked == asked)]


@pytest.mark.parametrize(("command", "files"), COMMANDS, ids=IDS)
def test_commands_write_by_the_door_and_keep_the_older_files(place, monkeypatch, command, files):
    folder, run = place
    command, before = worded(command, run), contents(folder)

    def call():
        done = run_here(*command, cwd=folder)
        assert done.code == 0, done.err

    found = opened_by(call, folder)
    assert other_doors(found) == []
    written = {name: data for name, data in contents(folder).items() if name not in before}
    assert len(written) == files == len(found)
    for name in written:
        (folder / name).write_bytes(b"older")
    older = contents(folder)
    for at in (1, 3, 4):  # opened, written, synced
        with fail_here(monkeypatch, FailingDisk(at, piece=1 << 30)):
            done = run_here(*command, cwd=folder)
        assert (done.code, done.err.count("Error: No space left on device; could not write: ")) == (3, 1), done.err
        assert contents(folder) == older


def test_a_file_opened_in_place_is_seen(tmp_path):
    """The control."""
    (name,) = other_doors(opened_by(lambda: (tmp_path / "table.csv").write_text("a"), tmp_path))
    assert name == "table.csv"


@pytest.mark.parametrize("command", [COMMANDS[0][0], COMMANDS[4][0]], ids=["predict", "ask"])
def test_a_disk_that_fails_at_the_nth_call_for_every_n(tmp_path, monkeypatch, command):
    """Each file is the older one or the whole new one."""
    assert run_here(*command, cwd=tmp_path).code == 0
    new = contents(tmp_path)
    for at in range(1, 100):
        for name in new:
            (tmp_path / name).write_bytes(b"older")
        disk = FailingDisk(at, piece=1 << 30)
        with fail_here(monkeypatch, disk):
            done = run_here(*command, cwd=tmp_path)
        if len(disk.calls) < at:
            break
        found = contents(tmp_path)
        assert done.code == 3
        assert found.keys() == new.keys()
        assert all(found[name] in (b"older", new[name]) for name in found)
        assert b"older" in found.values()
    assert at == 1 + 5 * len(new)
    assert contents(tmp_path) == new


@pytest.mark.parametrize("name", ["../../x", "/tmp/own-x", "a/b", "..", "o w n"])
def test_a_study_writes_nothing_outside_its_folder(place, name):
    folder, _ = place
    (folder / "study.toml").write_text(STUDY.replace('name = "own"', f'name = "{name}"'), encoding="utf-8")
    before = contents(folder.parent)
    command = ["study", "first-times", "study.toml", "--collect", "--runs-folder", "posed", "--out", "found"]
    done = run_here(*command, cwd=folder)
    assert done.code == 2
    assert "study name" in done.err
    assert contents(folder.parent) == before
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")  # the control
    assert run_here(*command, cwd=folder).code == 0
    assert {name.split("/")[1] for name in set(contents(folder.parent)) - set(before)} == {"found"}


@pytest.mark.parametrize("command", [COMMANDS[0][0], COMMANDS[3][0], COMMANDS[8][0]], ids=["predict", "derive", "book"])
def test_a_link_in_the_place_of_a_file_is_refused_before_any_work(tmp_path, command):
    name = next(word for word in command if str(word).endswith((".csv", ".net", ".toml")))
    victim = tmp_path / "victim"
    victim.write_bytes(b"mine")
    (tmp_path / name).symlink_to(victim)
    done = run_here(*command, cwd=tmp_path)
    assert done.code == 2
    assert f"{name} is a symbolic link" in done.err
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([name, "victim"])
    assert victim.read_bytes() == b"mine"
    (tmp_path / name).unlink()
    assert run_here(*command, cwd=tmp_path).code == 0  # the control
