"""Who answers the points: the same numbers from a Dask cluster, and a worker that dies is told in words."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster

from kinetics import Network, scan
from kinetics.predicting.scanning.executors import executor_of, results


def test_a_dask_cluster_gives_the_same_numbers():
    network = Network.from_text("A -> 0, k\nA = 10", k=1.0)
    asked = ({"k": [0.5, 1.0, 2.0, 4.0, 8.0]}, ["E[A] @ 0.3", "P=? [ F<=0.3 A < 8 ]"])
    here = scan(network, *asked, max_states=0, runs=20)
    with LocalCluster(n_workers=1, processes=False, dashboard_address=None) as cluster:
        there = scan(network, *asked, max_states=0, runs=20, workers=cluster.scheduler_address)
    for what in ("value", "low", "high"):
        np.testing.assert_array_equal(here.numbers(what), there.numbers(what))


SCRIPT = """
from kinetics import Network, scan
from kinetics.predicting.scanning.executors import executor_of
{}
"""
UNGUARDED = 'scan(Network.from_text("A -> 0, k", k=1.0), {"k": [1, 2, 3, 4, 5]}, "E[A] @ 1", workers=2)'
GUARDED = """
import os, time
if __name__ == "__main__":
    with executor_of(1 + 1) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        time.sleep(60)
"""


def script(folder, body):
    """A script of a user, run beside our sources."""
    (folder / "script.py").write_text(SCRIPT.format(body), encoding="utf-8")
    here = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[3]), *sys.path])}
    return subprocess.Popen(
        [sys.executable, "script.py"], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=here
    )


def test_a_script_without_a_guard_is_told_what_to_do(tmp_path):
    process = script(tmp_path, UNGUARDED)
    _, said = process.communicate()
    assert process.returncode == 1
    assert "workers cannot start; in a script, start workers under `if __name__ ==" in said
    assert "bootstrapping" not in said  # multiprocessing's own words


def test_workers_end_with_the_process_that_was_killed(tmp_path):
    process = script(tmp_path, GUARDED)
    worker = int(process.stdout.readline())
    os.kill(worker, 0)  # it is there
    process.kill()
    process.communicate()
    for _ in range(1000):
        try:
            os.kill(worker, 0)
        except ProcessLookupError:
            return
        time.sleep(0.01)
    os.kill(worker, signal.SIGKILL)
    pytest.fail("the worker outlived the process that started it")


def die(number):
    if number == 3:
        os._exit(1)
    return number


def test_a_worker_that_dies_is_told_and_one_that_does_not_is_heard():
    with executor_of(2) as pool:
        assert sorted(results(pool, die, [(1,), (2,)])) == [(0, 1), (1, 2)]
    with pytest.raises(ChildProcessError, match="start again with fewer workers"), executor_of(2) as pool:
        list(results(pool, die, [(3,)]))
