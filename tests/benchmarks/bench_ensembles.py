"""Overhead of an executor: wall time of short fake runs, two at a time, on this machine.

    python -m tests.benchmarks.bench_ensembles

The first run is listed apart, for it pays once for the server that workers are forked from, its imports, the cluster.
"""

from __future__ import annotations

import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from mechsim.runs.ensemble import run_all
from mechsim.runs.executors import Dask, Executor, Processes
from mechsim.runs.store import RunStore

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from fake_runs import execute, record_of, specs_of

RUNS, ROUNDS = 40, 5


def wall(executor: Executor | None, runs: int) -> float:
    """Seconds for so many runs; None: made here and written, by nobody else."""
    with tempfile.TemporaryDirectory() as folder:
        store, specs = RunStore(folder), specs_of(runs)
        begun = time.perf_counter()
        if executor is None:
            for spec in specs:
                store.write(record_of(spec))
        else:
            run_all(specs, store, workers=executor, execute=execute)
        return time.perf_counter() - begun


def row(name: str, executor: Executor | None) -> None:
    """Print the first run with its start-up, and the median of the rounds."""
    first = wall(executor, 1)
    times = sorted(1e3 * wall(executor, RUNS) / RUNS for _ in range(ROUNDS))
    print(f"{name:34s} {first:8.2f} s {times[ROUNDS // 2]:8.1f} ms   [{times[0]:.1f}, {times[-1]:.1f}]")


def main() -> None:
    """Print one row an executor."""
    import logging  # here, since every process of a run imports this module

    from distributed import LocalCluster

    print(f"{'two runs at a time':34s} {'first run':>10s} {'a run':>11s}   [least, most of {ROUNDS} rounds]")
    row("no executor: made and written", None)
    row("processes", Processes(2))
    settings = {"dashboard_address": "127.0.0.1:0", "silence_logs": logging.CRITICAL, "host": "127.0.0.1"}
    with closing(LocalCluster(n_workers=2, threads_per_worker=1, **settings)) as cluster:
        row("Dask, two workers of one thread", Dask(cluster.scheduler_address))


if __name__ == "__main__":
    main()
