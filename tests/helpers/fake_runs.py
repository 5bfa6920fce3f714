"""Runs that cost nothing, and misbehave on request: what the tests of the store and of ensembles execute.

As a script: `fake_runs.py FOLDER WORKERS SPECS [TIMEOUT]` is a driver of its own; it prints what came of the runs.
WORKERS is a number of processes, or the address of a scheduler.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import multiprocessing
import os
import resource
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mechsim.runs.ensemble import run_all
from mechsim.runs.executors import Dask, Processes
from mechsim.runs.record import RunRecord
from mechsim.runs.store import RunStore


@dataclass(frozen=True)
class FakeSpec:
    """Stands in for a RunSpec.

    behaviour : what `execute` does with it, see there
    log : file that gets one line for each start of a run, `run pid parent`; not an input
    """

    seed: int
    run: int
    duration: float = 10.0
    seconds: float = 0.0
    behaviour: str = "fine"
    log: str | None = None

    @property
    def inputs(self) -> dict[str, Any]:
        return asdict(replace(self, log=None, seconds=0.0)) | {
            "composition": {"monomer": 60},
            "sizes": [2, 2, 3],
            "rules": "0123456789",
            "scene": {"rules": "pairs", "tank": {"size": [2.0, 2.0, 3.0]}, "numerics": {"step": 0.25}},
            "physics": {"wellmixed": 1},
        }

    @cached_property
    def key(self) -> str:
        return hashlib.sha256(json.dumps(self.inputs, sort_keys=True).encode()).hexdigest()

    def check_can_be_made(self) -> None:
        """They can, by any version."""

    @property
    def title(self) -> str:
        return f"fake: {self.behaviour}, seed {self.seed}, run {self.run}"


def record_of(spec: FakeSpec, events: int = 40) -> RunRecord:
    rng = np.random.default_rng((spec.seed, spec.run))
    arrays = {
        "initial": np.array([60, 0], np.int64),
        "times": np.sort(rng.uniform(0, spec.duration, events)),
        "channels": rng.integers(-1, 2, events),
    }
    facts = {"end": spec.duration, "species": ["monomer", "dimer"], "channels": ["1+1->2", "2->1+1"], "steps": 7}
    facts["open_channels"] = [True, True]
    return RunRecord(spec, "completed", arrays, facts, {"cpu_seconds": time.process_time()})  # type: ignore[arg-type]


def specs_of(n: int, **settings: Any) -> list[FakeSpec]:
    return [FakeSpec(seed=5, run=run, **settings) for run in range(n)]


def begun(log: Path) -> list[tuple[int, int]]:
    """Run and process of every start so far."""
    lines = log.read_text().splitlines() if log.exists() else []
    return [(int(run), int(pid)) for run, pid, _ in map(str.split, lines)]


def starts(log: Path) -> list[int]:
    """Runs in the order of their starts."""
    return [run for run, _ in begun(log)]


def pids(log: Path) -> list[int]:
    """Processes that have started runs, in order."""
    return [pid for _, pid in begun(log)]


def parents(log: Path) -> list[int]:
    """Who asked for these processes: the driver, or a worker of a cluster."""
    return [int(line.split()[2]) for line in log.read_text().splitlines()] if log.exists() else []


def wait_for(condition: Callable[[], bool], seconds: float = 300) -> None:
    """Until it holds; the limit is only there to end a broken test."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never came to that"
        time.sleep(0.01)


def is_alive(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2]
    except FileNotFoundError:
        return False


def take_the_worker_down() -> None:
    os.kill(multiprocessing.parent_process().pid, signal.SIGKILL)
    time.sleep(600)


def execute(spec: FakeSpec, progress: Callable[[float], None]) -> RunRecord:
    os.write(1, b"an engine talks")
    tries = 1
    if spec.log is not None:
        with Path(spec.log).open("a") as log:
            log.write(f"{spec.run} {os.getpid()} {multiprocessing.parent_process().pid}\n")
        tries = starts(Path(spec.log)).count(spec.run)
    for tenth in range(10):
        time.sleep(spec.seconds / 10)
        progress(spec.duration * tenth / 10)
    match spec.behaviour:
        case "segfault":
            ctypes.string_at(0)
        case "segfault once" if tries == 1:
            os.kill(os.getpid(), signal.SIGSEGV)
        case "raise":
            raise RuntimeError("the cubes have left")
        case "full disk":
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
        case "wait for another driver":  # so that each of two makes a run, however long the other takes to start
            while len(set(parents(Path(spec.log)))) < 2:
                time.sleep(0.02)
        case "exit":
            os._exit(3)
        case "memory":
            room = 1 << 32
            resource.setrlimit(resource.RLIMIT_AS, (room, room))
            bytearray(2 * room)
        case "take the worker down":
            take_the_worker_down()
        case "take the worker down once" if tries == 1:
            take_the_worker_down()
        case "hang once" if tries == 1:
            time.sleep(600)
        case "hang":
            time.sleep(600)
        case "hang in native code":
            ctypes.PyDLL(None).sleep(600)  # holds the interpreter lock
    return record_of(spec)


class NotShared(RunStore):
    """A store whose folder is another one on the workers' machines."""

    def __reduce__(self):
        return RunStore, (self.folder.with_name("there"),)


def main(folder: str, workers: str, specs: str, timeout: str = "60") -> None:
    who = Processes(int(workers), float(timeout)) if workers.isdecimal() else Dask(workers, float(timeout))
    outcome = run_all([FakeSpec(**spec) for spec in json.loads(specs)], RunStore(folder), workers=who, execute=execute)
    json.dump({"digest": outcome.digest, "computed": outcome.computed, "reused": outcome.reused}, sys.stdout)


if __name__ == "__main__":
    main(*sys.argv[1:])
