import contextlib
import io
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import fake_runs
import pytest
from fake_runs import FakeSpec, begun, execute, is_alive, pids, record_of, specs_of, starts, wait_for

from mechsim.runs.ensemble import TRIES, run_all
from mechsim.runs.executors import processes
from mechsim.runs.executors.processes import AWAY, Processes, _interrupts_wait
from mechsim.runs.record import RunSpec
from mechsim.runs.record import execute as execute_run
from mechsim.runs.store import RunStore, digest_of
from mechsim.scene import Scene

ROOT = Path(__file__).parents[3]


def driver(folder, specs, workers=2, timeout=60):
    """A driver in a process group of its own, as a shell would start it."""
    described = json.dumps([asdict(spec) for spec in specs])
    return subprocess.Popen(
        [sys.executable, fake_runs.__file__, folder, str(workers), described, str(timeout)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def test_one_digest_for_any_number_of_workers_and_any_order(tmp_path):
    specs = specs_of(16)
    expected = digest_of(map(record_of, specs))
    for workers in (1, 2, 16):
        store = RunStore(tmp_path / str(workers))
        shuffled = random.Random(workers).sample(specs, len(specs))
        outcome = run_all(shuffled, store, workers=workers, execute=execute)
        assert [record.spec for record in outcome.records] == shuffled
        assert (outcome.computed, outcome.reused, outcome.quarantined) == (16, 0, ())
        assert outcome.digest == store.digest(shuffled)
        assert run_all(specs, store, workers=workers, execute=execute).digest == store.digest(specs) == expected


def test_only_what_is_missing_or_damaged_is_run(tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    specs = specs_of(6, log=str(log))
    whole = run_all(specs[:4], store, execute=execute)
    assert (whole.computed, whole.reused) == (4, 0)
    store.path(specs[2]).write_bytes(store.path(specs[2]).read_bytes()[:-1])
    log.unlink()
    with pytest.warns(RuntimeWarning, match="damaged"):
        outcome = run_all([*specs, specs[0]], store, workers=2, execute=execute)
    assert sorted(starts(log)) == [2, 4, 5]
    assert (outcome.computed, outcome.reused) == (3, 3)
    assert [record.spec for record in outcome.records] == [*specs, specs[0]]
    assert outcome.digest == digest_of(map(record_of, [*specs, specs[0]]))
    assert not list((store.folder / "claims").iterdir())


def test_a_run_that_always_fails_is_quarantined_and_the_others_go_on(tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    reasons = {
        "segfault": "killed by SIGSEGV",
        "raise": "RuntimeError: the cubes have left (fake_runs.py:",
        "exit": "exit code 3",
        "memory": "MemoryError",
    }
    bad = [FakeSpec(1, run, behaviour=kind, log=str(log)) for run, kind in enumerate(reasons, 100)]
    good = specs_of(6, log=str(log))
    specs = [good[0], bad[0], *good[1:4], bad[1], bad[2], *good[4:], bad[3]]
    outcome = run_all(specs, store, workers=2, execute=execute)
    assert outcome.digest == digest_of(map(record_of, good))
    assert [one.spec for one in outcome.quarantined] == bad
    for one, reason in zip(outcome.quarantined, reasons.values(), strict=True):
        assert len(one.reasons) == TRIES == starts(log).count(one.spec.run)
        assert all(reason in text for text in one.reasons)
        note = json.loads((store.folder / "quarantine" / f"{one.spec.key}.json").read_text())
        assert (note["title"], note["inputs"]) == (one.spec.title, one.spec.inputs)
        assert note["reasons"] == list(one.reasons)
    assert all(starts(log).count(spec.run) == 1 for spec in good)
    again = run_all(bad[:1], store, execute=execute)  # a later call tries anew
    assert [one.spec for one in again.quarantined] == bad[:1]
    assert starts(log).count(100) == 2 * TRIES


def test_a_run_that_crashes_once_is_run_again(tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    specs = [FakeSpec(1, 0, log=str(log)), FakeSpec(1, 1, behaviour="segfault once", log=str(log))]
    store.quarantine(specs[1], ["some earlier trouble"])
    outcome = run_all(specs, store, workers=2, execute=execute)
    assert outcome.digest == digest_of(map(record_of, specs))
    assert starts(log).count(1) == 2
    assert not list((store.folder / "quarantine").iterdir())


def test_a_note_of_earlier_failures_goes_with_a_run_that_is_found(tmp_path):
    """Who made the run may have been killed before the note was deleted."""
    store, specs = RunStore(tmp_path), specs_of(2)
    for spec in specs:
        store.write(record_of(spec))
        store.quarantine(spec, ["some earlier trouble"])
    assert run_all(specs[:1], store, execute=execute).reused == 1
    assert [path.stem for path in (tmp_path / "quarantine").iterdir()] == [specs[1].key]


@pytest.mark.parametrize(("away", "is_ended"), [(AWAY, False), (float("inf"), True)])
def test_a_sleep_between_two_looks_is_no_fault_of_a_run(tmp_path, monkeypatch, away, is_ended):
    """The machine sleeps while the driver reads or writes, not while it waits."""
    monkeypatch.setattr(processes, "AWAY", away)
    store, spec = RunStore(tmp_path), FakeSpec(1, 0, behaviour="hang")
    session, claim = Processes(1, timeout=600.0).open(store, execute), store.claim(spec)
    session.start(spec, claim)
    (attempt,) = session.attempts
    while not attempt.started:
        session.listen(0.01)
    later = SimpleNamespace(monotonic=lambda: time.monotonic() + 3600.0, sleep=time.sleep)
    monkeypatch.setattr(processes, "time", later)
    session.listen(0.0)
    assert attempt.ended is is_ended
    session.close()
    claim.release()


def test_a_pause_is_no_fault_of_a_run(tmp_path):
    """Ctrl-Z, or a machine that sleeps, stops the driver too; a worker that alone makes no progress is ended, which is
    in the contract of executors."""
    log, specs = tmp_path / "log", specs_of(1, seconds=2.0, log=str(tmp_path / "log"))
    with driver(tmp_path / "runs", specs, timeout=3.0) as process:
        wait_for(lambda: pids(log))
        os.killpg(process.pid, signal.SIGSTOP)
        time.sleep(3.0 + AWAY + 1.0)
        os.killpg(process.pid, signal.SIGCONT)
        outcome = json.loads(process.communicate()[0])
    assert len(starts(log)) == 1
    assert outcome["digest"] == digest_of(map(record_of, specs))


def test_workers_killed_at_random_cost_nothing_but_time(tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    specs = specs_of(8, seconds=0.2, log=str(log))
    chance, killed, over = random.Random(1), [], threading.Event()

    def kill():
        while not over.wait(chance.uniform(0.02, 0.15)):
            victims = [one for one in begun(log) if is_alive(one[1]) and killed.count(one[0]) < TRIES - 1]
            if victims:
                run, pid = chance.choice(victims)
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
                killed.append(run)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        outcome = run_all(specs, store, workers=2, execute=execute)
    finally:
        over.set()
        killer.join()
    assert len(killed) >= 4
    assert outcome.digest == digest_of(map(record_of, specs))
    assert outcome.computed == 8


def test_the_server_of_workers_may_be_killed_too(tmp_path):
    log, specs = tmp_path / "log", specs_of(4, seconds=0.5, log=str(tmp_path / "log"))

    def kill():
        wait_for(lambda: len(pids(log)) == 2)  # else a start is lost, and no run
        worker = Path(f"/proc/{pids(log)[0]}/stat").read_text().rpartition(")")[2].split()
        os.kill(int(worker[1]), signal.SIGKILL)  # its parent

    killer = threading.Thread(target=kill)
    killer.start()
    outcome = run_all(specs, RunStore(tmp_path / "runs"), workers=2, execute=execute)
    killer.join()
    assert len(starts(log)) > 4
    assert outcome.digest == digest_of(map(record_of, specs))


def test_drivers_killed_at_random_lose_at_most_the_runs_in_hand(tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    specs = specs_of(24, seconds=0.15, log=str(log))
    chance, finished = random.Random(2), 0
    for _ in range(3):
        begun = len(pids(log))
        with driver(store.folder, specs) as process:
            wait_for(lambda: len(pids(log)) > begun)  # noqa: B023
            time.sleep(chance.uniform(0.0, 0.3))
            process.kill()
        wait_for(lambda: not any(map(is_alive, pids(log))))  # workers end with their driver
        assert len(list(store.folder.glob("*.run"))) >= finished
        finished = len(list(store.folder.glob("*.run")))
    assert finished < 24  # else nothing was interrupted
    log.unlink()
    outcome = run_all(specs, store, workers=2, execute=execute)
    assert (outcome.computed, outcome.reused) == (24 - finished, finished)
    assert len(starts(log)) == 24 - finished
    assert outcome.digest == digest_of(map(record_of, specs))
    for spec in specs:  # the file of a driver that was killed just after its run was stored stays, and holds nothing
        claim = store.claim(spec)
        assert claim is not None
        claim.release()
    assert not list(store.folder.glob(".*"))


def test_a_worker_in_native_code_ends_with_its_driver(tmp_path):
    log = tmp_path / "log"
    with driver(tmp_path / "runs", [FakeSpec(1, 0, behaviour="hang in native code", log=str(log))]) as process:
        wait_for(lambda: pids(log))
        time.sleep(0.1)
        process.kill()
    wait_for(lambda: not is_alive(pids(log)[0]))


def test_ctrl_c_stops_the_workers_and_keeps_what_is_finished(tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    quick, slow = specs_of(2, log=str(log)), specs_of(4, seconds=60.0, log=str(log))[2:]
    with driver(store.folder, [*quick, *slow]) as process:
        wait_for(lambda: len(pids(log)) == 4)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == -signal.SIGINT
    assert errors.count("Traceback") == 1  # the driver's; workers go silently
    assert errors.strip().endswith("KeyboardInterrupt")
    assert not any(map(is_alive, pids(log)))
    assert store.digest(quick) == digest_of(map(record_of, quick))
    assert len(list(store.folder.glob("*.run"))) == 2


def test_two_drivers_share_a_folder_and_run_nothing_twice(tmp_path):
    log = tmp_path / "log"
    specs = specs_of(12, behaviour="wait for another driver", log=str(log))
    drivers = [driver(tmp_path / "runs", specs, workers=1) for _ in range(2)]
    outcomes = [json.loads(process.communicate()[0]) for process in drivers]  # and nothing but JSON is said
    assert sorted(starts(log)) == list(range(12))
    assert sum(outcome["computed"] for outcome in outcomes) == 12
    assert min(outcome["computed"] for outcome in outcomes) > 0
    assert all(outcome["computed"] + outcome["reused"] == 12 for outcome in outcomes)
    assert {outcome["digest"] for outcome in outcomes} == {digest_of(map(record_of, specs))}


def test_mistakes(tmp_path, capfd):
    store = RunStore(tmp_path)
    for workers in (0, -1):
        with pytest.raises(ValueError, match=f"workers = {workers}; expected 1 or more"):
            run_all(specs_of(1), store, workers=workers, execute=execute)
    for timeout in (0.0, float("nan")):
        with pytest.raises(ValueError, match="timeout = "):
            Processes(timeout=timeout)
    nowhere = type(execute)(execute.__code__, execute.__globals__, "execute")
    with pytest.raises(Exception, match="not the same object"):  # a function that a worker could not find
        run_all(specs_of(1), store, execute=nowhere)
    store.claim(specs_of(1)[0]).release()  # it has not kept its claim
    assert run_all([], store, execute=execute).records == ()


@pytest.mark.parametrize("n", [1, 3])
def test_a_script_without_a_main_guard_is_told_so(tmp_path, n):
    """Its workers load the script, and with it the call; of one run, they waited for the claim of their driver."""
    script = tmp_path / "script.py"
    script.write_text(
        f"from fake_runs import *\nrun_all(specs_of({n}), RunStore({str(tmp_path / 'runs')!r}), execute=execute)\n"
    )
    paths = os.pathsep.join([str(ROOT), str(Path(fake_runs.__file__).parent)])
    done = subprocess.run(
        [sys.executable, script], env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "workers cannot start; in a script, start workers under `if __name__ ==" in done.stderr
    assert "bootstrapping" not in done.stderr  # multiprocessing's own words
    assert not list((tmp_path / "runs" / "quarantine").iterdir())


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_is_for_terminals(tmp_path, monkeypatch):
    specs = specs_of(4, seconds=0.1, duration=250.0)
    for stream, wanted, shown in [
        (io.StringIO(), None, False),
        (Terminal(), None, True),
        (Terminal(), False, False),
        (io.StringIO(), True, True),
    ]:
        monkeypatch.setattr(sys, "stderr", stream)
        store = RunStore(tmp_path / str(id(stream)))
        run_all(specs, store, workers=2, progress=wanted, execute=execute)
        text = stream.getvalue()
        assert bool(text) == shown
        if shown:
            assert "4/4 runs" in text
            assert "1000/1000 tu" in text


def test_real_runs_are_the_same_here_in_workers_and_on_disk(tmp_path):
    pytest.importorskip("pybullet")
    scene = Scene.load("line4")
    specs = [RunSpec(scene, {"monomer": 20, "dimer": 4}, 0.5, seed=1, run=run) for run in range(3)]
    outcome = run_all(specs, RunStore(tmp_path), workers=2)
    assert outcome.digest == digest_of(map(execute_run, specs)) == RunStore(tmp_path).digest(specs)
    assert all(one.path.end == pytest.approx(0.5, abs=scene.numerics.step) for one in outcome.records)


@pytest.mark.validate
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("workers", [1, 2, 16])
def test_every_step_of_real_runs_is_the_same_for_any_number_of_workers(tmp_path, workers):
    """The digest is over the poses of all cubes at every step."""
    pytest.importorskip("pybullet")
    scene = Scene.load("line4")
    step = scene.numerics.step
    specs = [RunSpec(scene, {"monomer": 20, "dimer": 4}, 0.25, seed=1, run=run, poses=step) for run in range(16)]
    shuffled = random.Random(workers).sample(specs, len(specs))
    outcome = run_all(shuffled, RunStore(tmp_path), workers=workers)
    assert RunStore(tmp_path).digest(specs) == digest_of(map(execute_run, specs))
    assert all(len(record.arrays["pose_times"]) == record.facts["steps"] + 1 for record in outcome.records)


@contextlib.contextmanager
def masked():
    """What does not suffice: the mask of the main thread alone."""
    unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)


@pytest.mark.parametrize(("waiting", "comes_through"), [(_interrupts_wait, True), (masked, False)])
def test_ctrl_c_waits_until_a_worker_is_known(waiting, comes_through):
    """A thread of some library takes the signal while the main one blocks it; Python then interrupts the main one."""
    seen = []

    def take_it():
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # here, and before this thread goes on

    def start_worker():
        thread = threading.Thread(target=take_it)
        with waiting():
            thread.start()
            thread.join()
            seen.append("worker is known")

    with pytest.raises(KeyboardInterrupt):
        start_worker()
    assert bool(seen) is comes_through
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
