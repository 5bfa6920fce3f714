"""A Dask cluster of two workers on this machine, each a process with a nanny that starts it again.

What every executor must do: the contract of executors.
"""

import json
import logging
import os
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import asdict
from pathlib import Path

import fake_runs
import pytest
from command_line import run_here
from fake_runs import FakeSpec, execute, is_alive, pids, record_of, specs_of, starts, wait_for

from mechsim.runs.ensemble import run_all
from mechsim.runs.executors import Dask, cluster
from mechsim.runs.store import RunStore, digest_of

distributed = pytest.importorskip("distributed")
dask_config = pytest.importorskip("dask.config")
PATHS = os.pathsep.join([str(Path(__file__).parents[3]), str(Path(fake_runs.__file__).parent)])


def local_cluster():
    """Two workers, one run each at a time."""
    settings = {"dashboard_address": "127.0.0.1:0", "silence_logs": logging.CRITICAL, "host": "127.0.0.1"}
    return distributed.LocalCluster(n_workers=2, threads_per_worker=1, **settings)


@pytest.fixture(scope="module")
def two_workers():
    """For tests that leave it as it was."""
    with local_cluster() as cluster:
        yield cluster


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """A scheduler that shares a busy machine may take longer to answer than one elsewhere."""
    monkeypatch.setattr(cluster, "ANSWER_WITHIN", 60.0)


@pytest.fixture
def dask(two_workers):
    """The executor, with both workers up."""
    two_workers.wait_for_workers(2, timeout=300)
    return Dask(two_workers.scheduler_address)


def test_a_worker_killed_in_the_middle_of_a_run_costs_nothing_but_time(tmp_path, dask):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    specs = [FakeSpec(1, 100, behaviour="take the worker down once", log=str(log)), *specs_of(6, log=str(log))]
    outcome = run_all(specs, store, workers=dask, execute=execute)
    assert [starts(log).count(spec.run) for spec in specs] == [2, 1, 1, 1, 1, 1, 1]
    wait_for(lambda: not any(map(is_alive, pids(log))))  # the run did not outlive its worker
    assert (outcome.computed, outcome.quarantined) == (7, ())
    assert outcome.digest == digest_of(map(record_of, specs))


def test_a_run_that_takes_whole_workers_down_is_named(tmp_path):
    bad, good = FakeSpec(1, 100, behaviour="take the worker down"), specs_of(4)
    # Sooner than with Dask's 3; but then what waits on a lost worker may be blamed too, so the others go first.
    fewer = dask_config.set({"distributed.scheduler.allowed-failures": 1})
    with fewer, local_cluster() as cluster:
        outcome = run_all([*good, bad], RunStore(tmp_path), workers=Dask(cluster.scheduler_address), execute=execute)
    assert outcome.digest == digest_of(map(record_of, good))
    assert [one.spec for one in outcome.quarantined] == [bad]
    (reason,) = outcome.quarantined[0].reasons
    assert reason.startswith("2 workers of the cluster were lost while they made it, the last tcp://")


@pytest.mark.validate
@pytest.mark.timeout(1200)
def test_with_dasks_own_settings_it_costs_four_workers_and_no_other_run(tmp_path):
    """Amid others, on a cluster that goes on to make more runs."""
    bad, good = FakeSpec(1, 100, behaviour="take the worker down"), specs_of(8, seconds=0.4)
    with local_cluster() as cluster:
        dask = Dask(cluster.scheduler_address)
        outcome = run_all([*good[:3], bad, *good[3:]], RunStore(tmp_path / "one"), workers=dask, execute=execute)
        cluster.wait_for_workers(2, timeout=120)  # nannies start others for the lost ones
        again = run_all(good, RunStore(tmp_path / "two"), workers=dask, execute=execute)
    assert outcome.digest == again.digest == digest_of(map(record_of, good))
    assert [one.spec for one in outcome.quarantined] == [bad]
    assert outcome.quarantined[0].reasons[0].startswith("4 workers of the cluster were lost")


def driver(folder, dask, specs):
    """A driver in a process group of its own, as a shell would start it."""
    main = "import sys, fake_runs; fake_runs.main(*sys.argv[1:])"  # by its name in a module, for workers to find
    return subprocess.Popen(
        [sys.executable, "-c", main, folder, dask.address, json.dumps([asdict(spec) for spec in specs])],
        env=os.environ | {"PYTHONPATH": PATHS},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def test_ctrl_c_ends_the_runs_on_the_workers_and_keeps_what_is_finished(tmp_path, dask):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    quick, slow = specs_of(2, log=str(log)), specs_of(5, seconds=60.0, log=str(log))[2:]
    with driver(store.folder, dask, [*quick, *slow]) as process:
        wait_for(lambda: len(pids(log)) == 4)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == -signal.SIGINT
    assert errors.count("Traceback") == 1
    assert errors.strip().endswith("KeyboardInterrupt")
    wait_for(lambda: not any(map(is_alive, pids(log))))
    assert store.digest(quick) == digest_of(map(record_of, quick))
    assert len(list(store.folder.glob("*.run"))) == 2
    outcome = run_all(specs_of(3), store, workers=dask, execute=execute)  # and the workers are free again
    assert outcome.digest == digest_of(map(record_of, specs_of(3)))


def test_runs_of_a_driver_that_was_killed_are_finished_and_not_made_twice(tmp_path, dask):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    specs = specs_of(5, seconds=2.0, log=str(log))
    with driver(store.folder, dask, specs) as process:
        wait_for(lambda: len(pids(log)) == 2)
        process.kill()
    outcome = run_all(specs, store, workers=2, execute=execute)
    assert sorted(starts(log)) == list(range(5))
    assert (outcome.computed, outcome.reused) == (3, 2)
    assert outcome.digest == digest_of(map(record_of, specs))


def test_workers_that_do_not_share_the_disk_are_found(tmp_path, dask, monkeypatch):
    monkeypatch.setattr(cluster, "SEEN_WITHIN", 0.5)
    with pytest.raises(OSError, match="workers must share this folder under the same name"):
        run_all(specs_of(1), fake_runs.NotShared(tmp_path / "here"), workers=dask, execute=execute)


def test_a_command_makes_the_same_runs_on_a_cluster(tmp_path, dask):
    pytest.importorskip("pybullet")
    command = ["simulate", "line4", "--cubes", 6, "--duration", 1, "--runs", 2, "--seed", 2, "--json"]
    here = run_here(*command, "--runs-folder", "here", cwd=tmp_path).json
    there = run_here(*command, "--runs-folder", "there", "--scheduler", dask.address, cwd=tmp_path).json
    assert (here["computed"], there["computed"]) == (2, 2)
    assert there["digest"] == here["digest"]


@pytest.fixture
def by_hand(tmp_path):
    """by_hand(*command): start a part of a cluster as its command does; killed after the test."""
    started = []

    def start(*command, paths=PATHS):
        whole = [sys.executable, "-m", "dask", *map(str, command), "--dashboard-address", "127.0.0.1:0"]
        output = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        started.append(subprocess.Popen(whole, cwd=tmp_path, env=os.environ | {"PYTHONPATH": paths}, **output))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


def scheduler_of(by_hand, folder, **settings):
    """A scheduler, and the executor for it."""
    file = folder / "scheduler.json"
    process = by_hand("scheduler", "--host", "127.0.0.1", "--port", 0, "--scheduler-file", file, **settings)
    wait_for(lambda: file.exists() and file.read_text().strip().endswith("}"))
    return process, Dask(json.loads(file.read_text())["address"])


def test_a_scheduler_that_goes_away(tmp_path, by_hand):
    """The worker has two threads and no nanny."""
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    quick, slow = specs_of(3, log=str(log)), specs_of(5, seconds=60.0, log=str(log))[3:]
    scheduler, dask = scheduler_of(by_hand, tmp_path)
    with pytest.warns(UserWarning, match=f"the scheduler at {dask.address} has no workers yet; runs wait for one"):
        dask.open(store, execute).close()
    by_hand("worker", dask.address, "--nthreads", 2, "--no-nanny")
    with distributed.Client(dask.address, set_as_default=False) as client:
        client.wait_for_workers(1, timeout=300)

    def kill():
        wait_for(lambda: len(list(store.folder.glob("*.run"))) == 3 and len(pids(log)) == 5)
        scheduler.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(OSError, match=f"the scheduler at {dask.address} is gone, or .* finished runs are kept"):
        run_all([*quick, *slow], store, workers=dask, execute=execute)
    killer.join()
    assert store.digest(quick) == digest_of(map(record_of, quick))


class Lost:
    """A client whose scheduler has just gone, and a future that was on its way; `error` is what they raise."""

    def __init__(self, status, error):
        self.status, self.error = status, error

    def submit(self, *arguments, **options):
        raise self.error

    def result(self, timeout):
        raise self.error


@pytest.mark.parametrize(
    ("status", "error", "said"),
    [
        ("closed", Exception("Tried sending message after closing"), "is gone, or has dropped the runs"),
        ("connecting", distributed.comm.CommClosedError("in <TCP>"), "is gone, or has dropped the runs"),
        ("running", Exception("a fault of ours"), "a fault of ours"),  # the control
    ],
)
def test_a_scheduler_that_goes_away_while_it_is_talked_to(tmp_path, status, error, said):
    store, lost = RunStore(tmp_path), Lost(status, error)
    session, spec = cluster.ClusterSession(Dask("tcp://nowhere:1"), lost, store, execute), specs_of(1)[0]
    with pytest.raises(Exception, match=said) as failure:
        session.start(spec, store.claim(spec))
    assert isinstance(failure.value, OSError) is (said != "a fault of ours")
    if isinstance(error, OSError):
        session.attempts.append(cluster._Submitted(spec=spec, future=lost))
        with pytest.raises(OSError, match=said):
            session._hear(lost)


@pytest.mark.filterwarnings("ignore:the scheduler at .* has no workers yet")
def test_a_cluster_without_our_code(tmp_path, by_hand):
    _, dask = scheduler_of(by_hand, tmp_path, paths="")
    with pytest.raises(OSError, match=r"cannot make runs: .*need the same wellmixed as this machine"):
        run_all(specs_of(1), RunStore(tmp_path / "runs"), workers=dask, execute=execute)


def test_a_scheduler_that_does_not_answer(monkeypatch):
    monkeypatch.setattr(cluster, "ANSWER_WITHIN", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:  # listens, and never says a word
        for address in (f"tcp://127.0.0.1:{silent.getsockname()[1]}", "127.0.0.1:1", "nowhere", "ftp://x:1", ""):
            with pytest.raises(OSError, match=f"no Dask scheduler answers at '{address}': .*expected the address that"):
                Dask(address).check()


def test_the_address_of_a_worker_is_none_of_a_scheduler(two_workers, dask):
    address = next(iter(two_workers.scheduler.workers))
    with pytest.raises(ValueError, match="is the address of a Dask worker; expected that of its scheduler"):
        Dask(address).check()
    dask.check()
