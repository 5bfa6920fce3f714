"""Campaign on a Dask cluster of two workers on this machine: a worker or the scheduler is killed at some moment."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path

import fake_runs
from fake_runs import specs_of, starts

from mechsim.runs.store import RunStore
from tests.faults.disks import Try
from tests.faults.known_studies import Mutant, Study

PATHS = os.pathsep.join([str(Path(__file__).parents[2]), str(Path(fake_runs.__file__).parent)])
ENVIRONMENT = os.environ | {"PYTHONPATH": PATHS, "OPENBLAS_NUM_THREADS": "1"}
UP_WITHIN, DONE_WITHIN = 60.0, 120.0  # s
RUNS = 6


def dask(scratch: Path, mutant: Mutant) -> list[Try]:
    """No try where Dask is not installed."""
    chance = random.Random(4)
    victims = ["worker", "scheduler", "driver"] * 3
    if importlib.util.find_spec("distributed") is None:
        return []
    return [
        Try(f"{victim} killed after {runs} starts", victim, partial(_struck, victim, runs))
        for victim in victims
        for runs in (chance.randint(1, RUNS - 1),)
    ]


@contextlib.contextmanager
def _cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """Address of a scheduler; it and its two workers, which have no nanny."""
    folder.mkdir()
    file = folder / "scheduler.json"
    parts: list[subprocess.Popen] = []

    def begin(*command: str) -> None:
        whole = [sys.executable, "-m", "dask", *command, "--dashboard-address", "127.0.0.1:0"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        parts.append(subprocess.Popen(whole, cwd=folder, env=ENVIRONMENT, **quiet))

    try:
        begin("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
        _wait(lambda: file.exists() and file.read_text().strip().endswith("}"), UP_WITHIN)
        address = json.loads(file.read_text())["address"]
        for _ in range(2):
            begin("worker", address, "--nthreads", "1", "--no-nanny")
        yield address, parts
    finally:
        for part in parts:
            part.kill()
            part.wait()


def _struck(victim: str, runs: int, scratch: Path) -> list[str]:
    log, store = scratch / "log", RunStore(scratch / "runs")
    specs = specs_of(RUNS, seconds=0.3, log=str(log))
    study, main = Study(specs), "import sys, fake_runs; fake_runs.main(*sys.argv[1:])"
    with _cluster(scratch / "cluster") as (address, parts):
        driver = subprocess.Popen(
            [sys.executable, "-c", main, store.folder, address, json.dumps([asdict(spec) for spec in specs])],
            env=ENVIRONMENT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        _wait(lambda: len(starts(log)) >= runs, DONE_WITHIN)
        there = {path: path.read_bytes() for path in store.folder.glob("*.run")}
        {"worker": parts[-1], "scheduler": parts[0], "driver": driver}[victim].kill()
        try:
            said, errors = driver.communicate(timeout=DONE_WITHIN)
        except subprocess.TimeoutExpired:
            driver.kill()
            return ["the driver got stuck"]
    found = [f"{path.name[:8]} is lost" for path in there if not path.exists() or path.read_bytes() != there[path]]
    if victim == "worker" and (driver.returncode or json.loads(said)["digest"] != study.digest):
        found.append(f"the study has not survived a lost worker: {errors[-300:]}")
    if victim == "scheduler" and driver.returncode and "finished runs are kept" not in errors:
        found.append(f"another error: {errors[-300:]}")
    return found + study.losses(store.folder, [path.stem for path in there], scratch)


def _wait(condition, seconds: float) -> None:
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("a cluster has not come up")
        time.sleep(0.05)
