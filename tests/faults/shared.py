"""Campaigns on what surrounds a study: other drivers, workers that hang, clocks, folders of another version."""

from __future__ import annotations

import os
import random
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

from fake_runs import FakeSpec, record_of, specs_of, starts

from mechsim.runs import store as store_module
from mechsim.runs.executors import processes
from mechsim.runs.store import FORMAT, HEADER, MAGIC, RunStore
from tests.faults.disks import HUNG_AFTER, Try
from tests.faults.known_studies import Mutant, Study, fork_workers, kept, note_what_is_kept
from tests.faults.layer import KILL, Fault, Layer
from tests.faults.trying import MISTAKE, ended, in_child, start

LATER = 3600.0  # s, by which a clock jumps
LONG = 20.0  # s without progress; no run of ours takes so long


def drivers(scratch: Path, mutant: Mutant) -> list[Try]:
    """Two and four drivers in one new folder, all of them left alone or all but one killed at some call."""
    chance, tries = random.Random(1), []
    for n in (2, 4):
        tries.append(Try(f"{n} drivers", f"{n} drivers", partial(_share, n, {}, mutant)))
        for _ in range(6):
            victims = {one: chance.randint(1, 40) for one in range(n - 1)}
            label = f"{n} drivers, killed at calls {list(victims.values())}"
            tries.append(Try(label, f"{n} drivers, kills", partial(_share, n, victims, mutant)))
    return tries


def _share(n: int, victims: dict[int, int], mutant: Mutant, scratch: Path) -> list[str]:
    disk, log = scratch / "disk", scratch / "log"
    disk.mkdir()
    study = Study(specs_of(6, seconds=0.02, log=str(log)))

    def work(one: int) -> dict[str, object]:
        fork_workers()
        at = victims.get(one)
        layer = Layer(disk, scratch / f"trace{one}", None if at is None else Fault(KILL, at))
        layer.install()
        mutant()
        note_what_is_kept(layer)
        return study.make(disk / "runs")

    pids = [start(partial(work, one), scratch / f"driver{one}") for one in range(n)]
    endings = [ended(os.waitpid(pid, 0)[1], scratch / f"driver{one}") for one, pid in enumerate(pids)]
    found = [complaint for ending in endings for complaint in study.check(ending)]
    found += [f"driver {one} failed: {endings[one].said[-300:]}" for one in range(n) if endings[one].code == 3]
    most = 1 + len(victims)
    often = [run for run in set(starts(log)) if starts(log).count(run) > most]
    found += [f"run {run} was made more than {most} times" for run in often]
    keys = [key for one in range(n) for key in kept(scratch / f"trace{one}")]
    return found + study.losses(disk / "runs", keys, scratch, mutant)


def hung_runs(scratch: Path, mutant: Mutant) -> list[Try]:
    """A run that hangs once, alone and beside others."""

    def hang(workers: int, scratch: Path) -> list[str]:
        log = str(scratch / "log")
        spec = FakeSpec(1, 50, behaviour="hang once", log=log)
        study = Study([spec, *specs_of(2, log=log)], workers=workers, timeout=HUNG_AFTER)
        return study.losses(scratch / "runs", (), scratch, mutant)

    return [Try(f"a run hangs, {n} workers", "hang", partial(hang, n)) for n in (1, 2)]


def clocks(scratch: Path, mutant: Mutant) -> list[Try]:
    """The clock on the wall jumps back and forth; and the machine sleeps for an hour at some look at the time."""

    def wall(by: float, scratch: Path) -> list[str]:
        def jump() -> None:
            mutant()
            real, looks = time.time, iter(range(1 << 30))
            time.time = lambda: real() + by * next(looks)

        return Study.small(1).losses(scratch / "runs", (), scratch, jump)

    def sleep(at: int, scratch: Path) -> list[str]:
        log = scratch / "log"
        study = Study(specs_of(1, seconds=0.3, log=str(log)), timeout=LONG)

        def jump() -> None:
            mutant()
            looks = iter(range(1 << 30))
            processes.time = SimpleNamespace(  # type: ignore[attr-defined]
                monotonic=lambda: time.monotonic() + LATER * (next(looks) >= at), sleep=time.sleep
            )

        found = study.losses(scratch / "runs", (), scratch, jump)
        return found + (["a run that was well has been ended"] if len(starts(log)) > 1 else [])

    return [
        *(Try(f"the clock jumps by {by:g} s at each look", "jump", partial(wall, by)) for by in (-LATER, LATER, 1e8)),
        *(Try(f"asleep at look {at}", "sleep", partial(sleep, at)) for at in range(12)),
    ]


def versions(scratch: Path, mutant: Mutant) -> list[Try]:
    """Folders that another version has made are refused and left as they are; runs of another one are no hindrance."""
    study = Study.small(1)
    stranger = HEADER.pack(MAGIC, FORMAT + 1, 3)
    newer = stranger + store_module.hashlib.sha256(stranger + b"abc").digest() + b"abc"

    def refused(spoil: Callable[[Path], object], scratch: Path) -> list[str]:
        folder = scratch / "runs"
        RunStore(folder).write(record_of(study.good[0]))
        spoil(folder)
        before = _snapshot(folder)

        def work() -> object:
            fork_workers()
            mutant()
            return study.make(folder)

        done = in_child(work, scratch / "first")
        found = [] if done.code == MISTAKE and "name another folder" in done.said else [f"ended with code {done.code}"]
        return found + ([] if _snapshot(folder) == before else ["the folder was changed"])

    def beside(scratch: Path) -> list[str]:
        others = [replace(spec, seed=6) for spec in specs_of(3)]
        store = RunStore(scratch / "runs")
        for spec in others:
            store.write(record_of(spec))
        found = study.losses(store.folder, (), scratch, mutant)
        return found + [f"{spec.title} is lost" for spec in others if store.read(spec) is None]

    spoils: dict[str, Callable[[Path], object]] = {
        "a later format": lambda folder: (folder / "format").write_text(f"wellmixed runs, format {FORMAT + 1}\n"),
        "an older format": lambda folder: (folder / "format").write_text(f"wellmixed runs, format {FORMAT - 1}\n"),
        "no words": lambda folder: (folder / "format").write_bytes(b""),
        "not text": lambda folder: (folder / "format").write_bytes(bytes(range(256))),
        "a run of a later format": lambda folder: (folder / f"{study.good[0].key}.run").write_bytes(newer),
    }
    tries = [Try(label, label, partial(refused, spoil)) for label, spoil in spoils.items()]
    return [*tries, Try("runs of another version beside ours", "beside", beside)]


def _snapshot(folder: Path) -> dict[str, bytes]:
    """All files, but for claims, which hold nothing."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and path.parent.name != "claims"]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}
