"""Campaigns on the door for output, and on a real command with its mechanics."""

from __future__ import annotations

import json
import signal
import struct
import sys
from functools import partial
from pathlib import Path
from typing import Any

from command_line import run_here

from kinetics.support.output import new_folder, write_together, write_whole
from mechsim.runs.record import RunSpec
from mechsim.runs.record import execute as execute_run
from mechsim.scene import Scene
from tests.faults.disks import Try
from tests.faults.known_studies import Mutant, fork_workers, kept, note_what_is_kept
from tests.faults.layer import DEAD, FAIL, HALF, KILL, Fault, Layer, read_trace
from tests.faults.power import Disk, Tree, put
from tests.faults.trying import OUTSIDE, Ending, in_child

OLD, NEW = {"a.csv": "old a\n" * 300, "b.csv": "old b\n"}, {"a.csv": "new a\n" * 400, "b.csv": "new b\n"}


def door(scratch: Path, mutant: Mutant) -> list[Try]:
    """Two files that belong together are written anew, and a folder is made: struck at every call, and power lost."""
    disk, trace = scratch / "disk", scratch / "trace"
    _written(scratch, None, mutant)
    (calls,) = struct.unpack("q", (scratch / "count").read_bytes())
    tries = [
        Try(f"{kind} at call {at}", kind, partial(_struck, Fault(kind, at), mutant))
        for at in range(1, calls + 1)
        for kind in (KILL, HALF, FAIL, DEAD)
    ]
    model, is_done = Disk(disk), False
    for name, content in OLD.items():
        for event in (["create", name], ["content", name, content.encode().hex()], ["sync", name], ["sync", ""]):
            model.apply([event[0], str(disk.resolve() / event[1]), *event[2:]])
    for at, event in enumerate(read_trace(trace), 1):
        model.apply(event)
        is_done |= event[0] == "kept"
        for case, tree in model.states().items():
            label = f"power lost after note {at}, {event[0]}: {case}"
            tries.append(Try(label, case, partial(_unpowered, tree, is_done)))
    return tries


def _written(scratch: Path, fault: Fault | None, mutant: Mutant) -> Ending:
    disk = scratch / "disk"
    disk.mkdir()
    for name, content in OLD.items():
        (disk / name).write_text(content)
    layer = Layer(disk, scratch / "trace", fault)

    def work() -> None:
        layer.install()
        mutant()
        write_together({disk / name: content for name, content in NEW.items()})
        with new_folder(disk / "study") as made:
            write_whole(made / "plan.toml", "plan")
            write_whole(made / "book.toml", "book")
        layer.note("kept", "all")

    ending = in_child(work, scratch / "first")
    (scratch / "count").write_bytes(layer.count[:8])
    return ending


def _struck(fault: Fault, mutant: Mutant, scratch: Path) -> list[str]:
    ending = _written(scratch, fault, mutant)
    found = ending.complaints() + _torn(scratch / "disk")
    left = list((scratch / "disk").glob(".wellmixed-*"))
    if fault.kind == FAIL and left and ending.code == OUTSIDE and _failed(scratch) not in ("unlink", "rmdir"):
        found.append(f"{left[0].name} was left behind")
    return found + (["a write that was told to be done is not"] if ending.code == 0 and _is_old(scratch) else [])


def _failed(scratch: Path) -> str:
    """Name of the last call."""
    return [event[1] for event in read_trace(scratch / "trace") if event[0] == "call"][-1]


def _is_old(scratch: Path) -> bool:
    disk = scratch / "disk"
    return any((disk / name).read_text() != NEW[name] for name in NEW) or not (disk / "study").exists()


def _torn(disk: Path) -> list[str]:
    """What is neither as it was nor as it should be."""
    found = []
    for name, old in OLD.items():
        content = (disk / name).read_text() if (disk / name).exists() else None
        if content not in (old, NEW[name]):
            found.append(f"{name} is neither the old nor the new file")
    study = disk / "study"
    if study.exists() and {path.name: path.read_text() for path in study.iterdir()} != {
        "plan.toml": "plan",
        "book.toml": "book",
    }:
        found.append("half of a new folder is there")
    return found


def _unpowered(tree: Tree, is_done: bool, scratch: Path) -> list[str]:
    (scratch / "disk").mkdir()
    put(tree, scratch / "disk")
    found = _torn(scratch / "disk")
    return found + (["what was written is lost"] if is_done and _is_old(scratch) else [])


SCENE, CUBES, DURATION, SEED = "line4", 6, 0.25, 2
COMMAND = ("simulate", SCENE, "--cubes", CUBES, "--duration", DURATION, "--runs", 2, "--seed", SEED, "--json")


def command(scratch: Path, mutant: Mutant) -> list[Try]:
    """`wellmixed simulate` with its mechanics, killed or failed at every call of it and of its workers."""
    execute_run(RunSpec(Scene.load(SCENE), {"monomer": CUBES}, DURATION, SEED, 0), lambda _: None)  # kernels, once
    expected, layer = _simulated(scratch, None, mutant)
    (calls,) = struct.unpack("q", layer.count[:8])
    digest = expected.result["digest"]
    return [
        Try(f"{kind} at call {at} of simulate", kind, partial(_command_struck, Fault(kind, at), digest, mutant))
        for at in range(1, calls + 1)
        for kind in (KILL, FAIL)
    ]


def _simulate(runs: Path) -> dict[str, Any]:
    done = run_here(*COMMAND, "--runs-folder", runs, cwd=runs.parent.parent)
    if done.code:
        sys.stderr.write(done.err)
        sys.exit(done.code)
    return done.json


def _simulated(scratch: Path, fault: Fault | None, mutant: Mutant) -> tuple[Ending, Layer]:
    disk = scratch / "disk"
    disk.mkdir()
    layer = Layer(disk, scratch / "trace", fault)

    def work() -> dict[str, Any]:
        fork_workers()
        layer.install()
        mutant()
        note_what_is_kept(layer)
        return _simulate(disk / "a" / "runs")

    return in_child(work, scratch / "first"), layer


def _command_struck(fault: Fault, digest: str, mutant: Mutant, scratch: Path) -> list[str]:
    first, _ = _simulated(scratch, fault, mutant)
    runs, found = scratch / "disk" / "a" / "runs", first.complaints()
    if first.code != -signal.SIGKILL and "Traceback" in first.said:
        found.append("a traceback")
    lost = [key for key in kept(scratch / "trace") if not (runs / f"{key}.run").exists()]

    def again() -> dict[str, Any]:
        fork_workers()
        (scratch / "disk" / "a").mkdir(exist_ok=True)
        return _simulate(runs)

    second = in_child(again, scratch / "again")
    found += second.complaints() + [f"run {key[:8]} was kept, and is lost" for key in lost]
    for ending in (first, second):
        if ending.code == 0 and ending.result["digest"] != digest:
            found.append(f"another digest: {json.dumps(ending.result)[:300]}")
    return found + (["the same command fails"] if second.code else [])
