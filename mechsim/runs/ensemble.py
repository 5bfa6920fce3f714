"""Ensembles of runs: those missing from a store are made, each with up to three tries."""

from __future__ import annotations

import sys
from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass

from kinetics.support.cli.progress import is_heard, is_terminal, progress_line
from kinetics.support.workers import end_while_loading
from mechsim.runs.executors import Executor, Processes, RunAttempt, Session
from mechsim.runs.executors.base import LOOK_EVERY, Execute
from mechsim.runs.record import RunRecord, RunSpec
from mechsim.runs.record import execute as execute_run
from mechsim.runs.store import RunStore, digest_of

TRIES = 3


@dataclass(frozen=True)
class Quarantined:
    """A run that was given up, with one reason for each try.

    >>> from mechsim import Quarantined, RunSpec, Scene
    >>> spec = RunSpec(Scene.load("line4"), {"monomer": 4}, duration=0.1, seed=1, run=0)
    >>> given_up = Quarantined(spec, ("ended by signal 11",) * 3)
    >>> given_up.spec.title, len(given_up.reasons)
    ('line4: 4 monomer, 0.1 tu, seed 1, run 0', 3)
    """

    spec: RunSpec
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """The outcome of an ensemble.

    records : finished runs, in the order of the specs
    quarantined : runs that failed at every try, in that order too; the next call tries them again
    computed, reused : numbers of runs that this call made, and that it found or that another process made meanwhile

    >>> from tempfile import TemporaryDirectory
    >>> from mechsim import RunSpec, RunStore, Scene, execute, run_all
    >>> folder = TemporaryDirectory()
    >>> store = RunStore(folder.name)
    >>> specs = [RunSpec(Scene.load("line4"), {"monomer": 4}, duration=0.1, seed=1, run=run) for run in range(2)]
    >>> paths = [store.write(execute(spec)) for spec in specs]
    >>> outcome = run_all(specs, store)
    >>> outcome.reused, outcome.digest == store.digest(specs), outcome.quarantined
    (2, True, ())
    >>> folder.cleanup()
    """

    records: tuple[RunRecord, ...]
    quarantined: tuple[Quarantined, ...]
    computed: int
    reused: int

    @property
    def digest(self) -> str:
        """SHA-256 over the results: the same for any number of workers and however often the work was interrupted."""
        return digest_of(self.records)

    @property
    def sound(self) -> list[RunRecord]:
        """Runs that reached their end."""
        return [record for record in self.records if record.completed]

    @property
    def problems(self) -> list[str]:
        """A message for each run that the guard stopped or that was given up."""
        stopped = [f"{record.spec.title}: {record.outcome}" for record in self.records if not record.completed]
        return stopped + [f"{one.spec.title}: given up: {one.reasons[-1]}" for one in self.quarantined]

    @property
    def cpu_seconds(self) -> float:
        """CPU time of all finished runs, s."""
        return sum(record.cost["cpu_seconds"] for record in self.records)


def run_all(
    specs: Iterable[RunSpec],
    store: RunStore,
    *,
    workers: int | Executor = 1,
    progress: bool | None = None,
    execute: Execute = execute_run,
) -> Outcome:
    """Make the runs that are missing from the store, and read the others.

    workers : number of processes on this machine, one per run; or another executor, as Dask("tcp://10.0.0.5:8786")
    progress : whether to show a line on standard error; None: only on a terminal
    execute : function that makes the record of one run; it is called in the worker, so it must be importable by name

    A run that crashes, raises or hangs is tried three times, then noted in the store's quarantine. Ctrl-C stops the
    workers and is raised again; finished runs are kept. OSError: the store cannot be written, or a scheduler is gone;
    all work stops. ValueError: a worker has other versions than this process, which would give other records, or a run
    that is not stored belongs to another version of the mechanics. A script that calls this needs the usual
    `if __name__ == "__main__":`.

    >>> from tempfile import TemporaryDirectory
    >>> from mechsim import RunSpec, RunStore, Scene, run_all
    >>> folder = TemporaryDirectory()
    >>> store = RunStore(folder.name)
    >>> spec = RunSpec(Scene.load("line4"), {"monomer": 4}, duration=0.1, seed=1, run=0)
    >>> run_all([spec], store).computed, run_all([spec], store).reused
    (1, 1)
    >>> folder.cleanup()
    """
    end_while_loading()
    executor = Processes(workers) if isinstance(workers, int) else workers
    specs = list(specs)
    driver = _Driver({spec.key: spec for spec in specs}, store)
    driver.run(executor.open(store, execute), progress)
    keys = [spec.key for spec in specs]
    return Outcome(
        records=tuple(driver.records[key] for key in keys if key in driver.records),
        quarantined=tuple(driver.quarantined[key] for key in dict.fromkeys(keys) if key in driver.quarantined),
        computed=driver.computed,
        reused=len(driver.records) - driver.computed,
    )


class _Driver:
    """The state of one call: runs that wait, and results. The session knows what is running."""

    def __init__(self, specs: dict[str, RunSpec], store: RunStore) -> None:
        self.specs, self.store = specs, store
        self.failures: defaultdict[str, list[str]] = defaultdict(list)
        self.quarantined: dict[str, Quarantined] = {}
        self.computed = 0
        found = ((key, store.read(spec)) for key, spec in specs.items())
        self.records = {key: record for key, record in found if record is not None}
        for key in self.records:  # who made it may have been killed before the note of earlier failures was deleted
            store.absolve(specs[key])
        self.waiting = deque(spec for key, spec in specs.items() if key not in self.records)
        for spec in self.waiting:
            spec.check_can_be_made()

    def run(self, session: Session, progress: bool | None) -> None:
        """Work until nothing waits and nothing runs."""
        total = sum(spec.duration for spec in self.specs.values())
        # A script that is no command of ours has asked for no lines of ours, unless somebody looks on.
        shown = is_terminal(sys.stderr) if progress is None and not is_heard() else progress
        with progress_line(shown) as line:

            def tell() -> None:
                done = self._simulated(session)
                text = f"{len(self.records)}/{len(self.specs)} runs, {done:.0f}/{total:.0f} tu"
                line(text, done / total if total else None)

            tell()
            try:
                while self.waiting or session.attempts:
                    self._start(session)
                    if self.waiting or session.attempts:  # else the last run was found, made by another process
                        session.listen(LOOK_EVERY if self.waiting and session.has_room() else None)
                    for attempt in [attempt for attempt in session.attempts if attempt.ended]:
                        self._finish(attempt)
                        session.attempts.remove(attempt)
                    tell()
            finally:
                session.close()
                for attempt in session.attempts:
                    if attempt.claim is not None:
                        attempt.claim.release()

    def _simulated(self, session: Session) -> float:
        """Simulated time so far, tu; a run that ended, however it did, counts in full."""
        ended = sum(self.specs[key].duration for key in (*self.records, *self.quarantined))
        return ended + sum(attempt.simulated for attempt in session.attempts)

    def _start(self, session: Session) -> None:
        """Start waiting runs that nobody else has claimed, while there is room."""
        for _ in range(len(self.waiting)):
            if not session.has_room():
                return
            spec = self.waiting.popleft()
            claim = self.store.claim(spec)
            if claim is None:
                self.waiting.append(spec)
                continue
            record = self.store.read(spec)
            if record is not None:  # made by another process since we looked
                self.records[spec.key] = record
                claim.release()
                continue
            try:
                session.start(spec, claim)
            except BaseException:
                if not any(attempt.claim is claim for attempt in session.attempts):
                    claim.release()
                raise

    def _finish(self, attempt: RunAttempt) -> None:
        """Take in the run of an attempt that has ended, or note why there is none."""
        spec = attempt.spec
        record = self.store.read(spec)
        if attempt.is_elsewhere:
            self.waiting.append(spec)
        elif record is not None:
            self.records[spec.key] = record
            self.computed += 1
            self.store.absolve(spec)
        else:
            self._fail(attempt)
        if attempt.claim is not None:
            attempt.claim.release()

    def _fail(self, attempt: RunAttempt) -> None:
        """Try a run again, later, or give it up."""
        spec, reasons = attempt.spec, self.failures[attempt.spec.key]
        reasons.append(attempt.failure)
        if len(reasons) < TRIES and not attempt.is_last:
            self.waiting.append(spec)
        else:
            self.store.quarantine(spec, reasons)
            self.quarantined[spec.key] = Quarantined(spec, tuple(reasons))
