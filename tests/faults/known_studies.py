"""A small study that is struck, and what must be true of it afterwards.

Its runs cost nothing. One of them fails at every try and is given up; of another one, an older note says so and is to
go. Workers are forked from the driver, so that one layer covers both.
"""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fake_runs import FakeSpec, execute, record_of, specs_of

from mechsim.runs.ensemble import run_all
from mechsim.runs.executors import Processes
from mechsim.runs.store import RunStore, digest_of
from tests.faults.layer import Fault, Layer, read_trace
from tests.faults.trying import Ending, in_child

Mutant = Callable[[], None]


def unchanged() -> None:
    """No mutant."""


@dataclass(frozen=True)
class Study:
    """Runs to be made in one folder.

    good, bad : runs that can be made, and that fail at every try; workers, timeout : of the executor
    """

    good: Sequence[FakeSpec]
    bad: Sequence[FakeSpec] = ()
    workers: int = 1
    timeout: float | None = None

    @classmethod
    def small(cls, runs: int = 2) -> Study:
        """The one that is struck at every call."""
        return cls(specs_of(runs), [FakeSpec(1, 100, behaviour="raise")])

    @cached_property
    def digest(self) -> str:
        """Of an undisturbed study."""
        return digest_of(map(record_of, self.good))

    def make(self, folder: Path) -> dict[str, Any]:
        """The command: make what is missing."""
        store = RunStore(folder)
        workers = Processes(self.workers, self.timeout)
        outcome = run_all([*self.good, *self.bad], store, workers=workers, progress=False, execute=execute)
        given_up = [one.spec.run for one in outcome.quarantined]
        return {"digest": outcome.digest, "computed": outcome.computed, "given_up": given_up}

    def struck(self, scratch: Path, fault: Fault | None, mutant: Mutant = unchanged) -> tuple[Ending, Layer]:
        """Make it from nothing in `scratch/disk`, with a layer in between."""
        disk = scratch / "disk"
        disk.mkdir(parents=True)
        layer = Layer(disk, scratch / "trace", fault)

        def work() -> dict[str, Any]:
            fork_workers()
            layer.install()
            mutant()
            note_what_is_kept(layer)
            RunStore(disk / "a" / "runs").quarantine(self.good[0], ["some earlier trouble"])
            return self.make(disk / "a" / "runs")

        return in_child(work, scratch / "first"), layer

    def losses(self, folder: Path, kept: Sequence[str], scratch: Path, mutant: Mutant = unchanged) -> list[str]:
        """What is wrong with a folder after a fault, where the same command is given again.

        kept : keys of runs that were on disk before the fault, as far as the store has said
        """

        def work() -> dict[str, Any]:
            fork_workers()
            mutant()
            there = [key for key in kept if (folder / f"{key}.run").exists()]
            return {"there": there} | self.make(folder)

        again = in_child(work, scratch / "again")
        found = again.complaints()
        if again.code == 0:
            result = again.result
            found += [f"run {key[:8]} was kept, and is lost" for key in kept if key not in result["there"]]
            if result["digest"] != self.digest:
                found.append("another digest")
            if result["given_up"] != [spec.run for spec in self.bad]:
                found.append(f"runs given up: {result['given_up']}")
            notes = {path.stem for path in (folder / "quarantine").glob("*.json")}
            if notes != {spec.key for spec in self.bad}:
                found.append(f"{len(notes)} notes of runs given up")
        elif not found:
            found.append(f"the same command fails: {again.said[-300:]}")
        return found

    def check(self, first: Ending) -> list[str]:
        """What is wrong with the study that was struck, as far as it came to an end."""
        found = first.complaints()
        if first.code == 0 and (first.result["digest"], first.result["given_up"]) != (
            self.digest,
            [spec.run for spec in self.bad],
        ):
            found.append(f"it came to an end and was wrong: {json.dumps(first.result)}")
        return found


def fork_workers() -> None:
    """Let workers be forked from their driver, layer and all."""
    real = multiprocessing.get_context
    multiprocessing.get_context = lambda method=None: real("fork")  # type: ignore[assignment]


def note_what_is_kept(layer: Layer) -> None:
    """A note each time the store says that a run is on disk."""
    real = RunStore.write

    def write(store: RunStore, record: Any) -> Path:
        path = real(store, record)
        layer.note("kept", record.spec.key)
        return path

    RunStore.write = write  # type: ignore[method-assign]


def kept(trace: Path) -> list[str]:
    """Keys of the runs that were kept."""
    return [event[1] for event in read_trace(trace) if event[0] == "kept"]
