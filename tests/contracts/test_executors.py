"""What every executor must do: each case runs for each member of EXECUTORS, with two workers and runs that are fakes.

An executor that needs a server has a line in SERVERS; any other is what the command line makes of no value at all.
"""

import logging
import re
import threading
import time
from contextlib import contextmanager, nullcontext

import pytest
from fake_runs import FakeSpec, execute, is_alive, pids, record_of, specs_of, starts, wait_for

from mechsim.runs import ensemble
from mechsim.runs.ensemble import TRIES, run_all
from mechsim.runs.executors import EXECUTORS, Executor
from mechsim.runs.store import RunStore, digest_of


@contextmanager
def local_cluster():
    """Address of a Dask cluster on this machine."""
    distributed = pytest.importorskip("distributed")
    settings = {"dashboard_address": "127.0.0.1:0", "silence_logs": logging.CRITICAL, "host": "127.0.0.1"}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **settings) as cluster:
        cluster.wait_for_workers(2, timeout=300)
        yield cluster.scheduler_address


SERVERS = {"--scheduler": local_cluster}
every_executor = pytest.mark.parametrize("kind", EXECUTORS, ids=lambda kind: kind.__name__)


@pytest.fixture(scope="module", params=EXECUTORS, ids=lambda kind: kind.__name__)
def executor(request):
    """Ready to be used, and used by all cases."""
    kind = request.param
    with SERVERS.get(kind.option, nullcontext)() as value:
        yield kind.from_option(value, None)


@every_executor
def test_one_option_of_the_command_line_chooses_it(kind):
    assert issubclass(kind, Executor)
    assert re.fullmatch(r"--[a-z]+(-[a-z]+)*", kind.option)
    assert [other.option for other in EXECUTORS].count(kind.option) == 1
    assert kind.help.endswith((".", "]"))
    assert kind.__doc__
    for timeout in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match=r"timeout = .*; expected seconds above 0, or none"):
            kind.from_option(None, timeout)
    assert kind.from_option(None, 9.0) == kind.from_option(None, 9.0) != kind.from_option(None, 8.0)


def test_the_first_needs_no_server():
    """It is the one where none is asked for."""
    assert EXECUTORS[0].option not in SERVERS
    assert EXECUTORS[0].from_option(None, None).check() is None


def test_only_what_is_missing_is_made_and_nothing_is_said(executor, tmp_path, capfd):
    executor.check()
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    specs = specs_of(5, log=str(log))
    store.write(record_of(specs[3]))
    outcome = run_all([*specs, specs[0]], store, workers=executor, execute=execute)
    assert [record.spec for record in outcome.records] == [*specs, specs[0]]
    assert (outcome.computed, outcome.reused, outcome.quarantined) == (4, 1, ())
    assert sorted(starts(log)) == [0, 1, 2, 4]
    assert outcome.digest == digest_of(map(record_of, [*specs, specs[0]]))
    assert store.digest(specs) == digest_of(map(record_of, specs))
    assert not list((store.folder / "claims").iterdir())
    assert capfd.readouterr().out == ""


def test_a_run_that_always_fails_is_named_and_the_others_go_on(executor, tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    reasons = {"segfault": "killed by SIGSEGV", "raise": "RuntimeError: the cubes have left (fake_runs.py:"}
    bad = [FakeSpec(1, run, behaviour=kind, log=str(log)) for run, kind in enumerate(reasons, 100)]
    once = FakeSpec(1, 200, behaviour="segfault once", log=str(log))
    good = [*specs_of(3, log=str(log)), once]
    outcome = run_all([*bad, *good], store, workers=executor, execute=execute)
    assert outcome.digest == digest_of(map(record_of, good))
    assert [one.spec for one in outcome.quarantined] == bad
    for one, reason in zip(outcome.quarantined, reasons.values(), strict=True):
        assert len(one.reasons) == TRIES == starts(log).count(one.spec.run)
        assert all(reason in text for text in one.reasons)
    assert [starts(log).count(spec.run) for spec in good] == [1, 1, 1, 2]
    assert not list((store.folder / "claims").iterdir())


def test_a_run_that_hangs_is_ended(executor, tmp_path, monkeypatch):
    """After its time without progress, in native code too; a run that reports is not, however long it takes."""
    monkeypatch.setattr(ensemble, "TRIES", 1)
    patient = type(executor)(**vars(executor) | {"timeout": 4.0})
    hung, slow = FakeSpec(1, 0, behaviour="hang in native code"), FakeSpec(1, 1, seconds=5.0)
    outcome = run_all([hung, slow], RunStore(tmp_path), workers=patient, execute=execute)
    assert [record.spec for record in outcome.records] == [slow]
    assert [one.spec for one in outcome.quarantined] == [hung]
    assert "no progress for 4 s" in outcome.quarantined[0].reasons[0]


def test_a_run_that_another_process_makes_is_waited_for(executor, tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    specs = specs_of(3, log=str(log))
    claims = {run: store.claim(specs[run]) for run in (0, 1)}

    def elsewhere():
        wait_for(lambda: pids(log))
        store.write(record_of(specs[0]))  # one is made,
        claims[0].release()
        time.sleep(0.3)
        claims[1].release()  # and one is given up

    thread = threading.Thread(target=elsewhere)
    thread.start()
    outcome = run_all(specs, store, workers=executor, execute=execute)
    thread.join()
    assert starts(log) == [2, 1]
    assert (outcome.computed, outcome.reused) == (2, 1)
    assert outcome.digest == digest_of(map(record_of, specs))


def test_what_every_run_would_meet_ends_the_call(executor, tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    full = FakeSpec(1, 0, behaviour="full disk")
    with pytest.raises(OSError, match=f"could not write.*{full.key}"):
        run_all([full, *specs_of(2, seconds=600.0, log=str(log))], store, workers=executor, execute=execute)
    stranger = FakeSpec(1, 1)
    vars(stranger)["key"] = "0" * 64  # as if asked for with other versions
    with pytest.raises(ValueError, match=r"has rules .* the run was requested with others"):
        run_all([stranger], store, workers=executor, execute=execute)
    wait_for(lambda: not any(map(is_alive, pids(log))))
    assert not list(store.folder.glob("*.run"))
    assert not list((store.folder / "quarantine").iterdir())


def test_a_session_that_is_closed_leaves_nothing_at_work(executor, tmp_path):
    log, store = tmp_path / "log", RunStore(tmp_path / "runs")
    spec = FakeSpec(1, 0, seconds=60.0, log=str(log))
    session, claim = executor.open(store, execute), store.claim(spec)
    assert session.has_room()
    session.start(spec, claim)
    assert [attempt.spec for attempt in session.attempts] == [spec]
    assert not session.attempts[0].ended
    wait_for(lambda: pids(log))
    session.close()
    claim.release()
    wait_for(lambda: not is_alive(pids(log)[0]))
    assert not list(store.folder.glob("*.run"))
