"""Many runs, a process each: a run that crashes in the engine costs itself a try, and the others nothing."""

from __future__ import annotations

import multiprocessing
import signal
import threading
import time
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from typing import Any

from mechsim.record import RunRecord, RunSpec
from mechsim.record import execute as execute_run
from mechsim.store import Claim, RunStore, digest_of
from mechsim.worker import Execute, work

TRIES = 3
MOST_LOST_STARTS = 100  # in one call, before we believe that no worker will ever start
LOOK_EVERY = 0.2  # s between two looks at runs that another process has claimed


@dataclass(frozen=True)
class Quarantined:
    """A run that was given up, with one reason for each try."""

    spec: RunSpec
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """What came of an ensemble.

    records : finished runs, in the order of the specs
    quarantined : runs that failed at every try, in that order too; the next call tries them again
    computed, reused : runs that this call made, and runs that it found (or that another process made meanwhile)
    """

    records: tuple[RunRecord, ...]
    quarantined: tuple[Quarantined, ...]
    computed: int
    reused: int

    @property
    def digest(self) -> str:
        """SHA-256 over what happened: equal for any number of workers, and however often the work was interrupted."""
        return digest_of(self.records)


def run_all(
    specs: Iterable[RunSpec],
    store: RunStore,
    *,
    workers: int = 1,
    progress: bool | None = None,
    timeout: float | None = None,
    execute: Execute = execute_run,
) -> Outcome:
    """Make the runs that are missing from the store, at most `workers` at a time, and read the others.

    progress : a bar on standard error; None: only where that is a terminal
    timeout : s without progress after which a run counts as hung (leave room for compiling kernels); None: never
    execute : makes the record of one run; called in the worker, so it must be found by its name in a module

    A run that crashes, raises or hangs is tried three times, then noted in the store's quarantine. Ctrl-C stops the
    workers and passes on; what has finished is kept. OSError: the store cannot be written; all
    work stops.
    A script that calls this needs the usual `if __name__ == "__main__":`.
    """
    if workers < 1:
        raise ValueError(f"workers = {workers}; expected 1 or more")
    if timeout is not None and not timeout > 0:
        raise ValueError(f"timeout = {timeout}; expected seconds above 0, or none")
    specs = list(specs)
    driver = _Driver({spec.key: spec for spec in specs}, store, workers, timeout, execute)
    driver.run(progress)
    keys = [spec.key for spec in specs]
    return Outcome(
        records=tuple(driver.records[key] for key in keys if key in driver.records),
        quarantined=tuple(driver.quarantined[key] for key in dict.fromkeys(keys) if key in driver.quarantined),
        computed=driver.computed,
        reused=len(driver.records) - driver.computed,
    )


@dataclass
class _Worker:
    """A process that makes one run, as the driver sees it."""

    spec: RunSpec
    claim: Claim
    process: ForkServerProcess
    reports: Connection
    heard: float  # s, when it last reported
    started: bool = False
    simulated: float = 0.0  # tu
    failure: str = ""
    ended: bool = False


class _Driver:
    """The state of one call: what waits, what runs, what came of it."""

    def __init__(
        self, specs: dict[str, RunSpec], store: RunStore, workers: int, timeout: float | None, execute: Execute
    ) -> None:
        self.specs, self.store, self.workers, self.timeout, self.execute = specs, store, workers, timeout, execute
        self.running: list[_Worker] = []
        self.failures: defaultdict[str, list[str]] = defaultdict(list)
        self.lost_starts = 0
        self.quarantined: dict[str, Quarantined] = {}
        self.computed = 0
        found = ((key, store.read(spec)) for key, spec in specs.items())
        self.records = {key: record for key, record in found if record is not None}
        self.waiting = deque(spec for key, spec in specs.items() if key not in self.records)
        self.context = multiprocessing.get_context("forkserver")
        # What a run needs is imported once, in the server that workers are forked from.
        self.context.set_forkserver_preload([execute.__module__, "mechsim.worker", "mechsim.world"])

    def run(self, progress: bool | None) -> None:
        """Work until nothing waits and nothing runs."""
        from tqdm import tqdm

        with tqdm(
            desc=f"{len(self.records)}/{len(self.specs)} runs",
            total=sum(spec.duration for spec in self.specs.values()),
            initial=self._simulated(),
            disable=None if progress is None else not progress,
            dynamic_ncols=True,
            bar_format="{desc}|{bar}| {n:.0f}/{total:.0f} tu [{elapsed}, {remaining} left, {rate_fmt}]",
            unit="tu",
        ) as bar:
            try:
                while self.waiting or self.running:
                    self._start_workers()
                    if self.waiting or self.running:  # else the last run was found, made by another process
                        self._listen()
                    for worker in [worker for worker in self.running if worker.ended]:
                        self._finish(worker)
                    bar.set_description(f"{len(self.records)}/{len(self.specs)} runs", refresh=False)
                    bar.update(self._simulated() - bar.n)
            finally:
                for worker in self.running:
                    worker.process.kill()  # files are written whole or not at all: nothing needs to be tidied up
                for worker in self.running:
                    self._part(worker)

    def _simulated(self) -> float:
        """Simulated time so far, tu; a run that ended, however it did, counts in full."""
        ended = sum(self.specs[key].duration for key in (*self.records, *self.quarantined))
        return ended + sum(worker.simulated for worker in self.running)

    def _start_workers(self) -> None:
        """Give free places to waiting runs that nobody else has claimed."""
        for _ in range(len(self.waiting)):
            if len(self.running) == self.workers:
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
                with _interrupts_wait():  # until the driver knows the worker, and the server has all that it needs
                    self.running.append(self._worker(spec, claim))
            except (EOFError, ConnectionError) as error:  # the server that workers are forked from was killed: no
                claim.release()  # fault of the run, and a new server comes up in a moment
                self.waiting.appendleft(spec)
                self.lost_starts += 1
                if self.lost_starts > MOST_LOST_STARTS:
                    raise RuntimeError(f"workers cannot be started: their server ends at once ({error!r})") from error
                time.sleep(LOOK_EVERY / 4)
                return
            except BaseException:
                if not any(worker.claim is claim for worker in self.running):
                    claim.release()
                raise

    def _worker(self, spec: RunSpec, claim: Claim) -> _Worker:
        """A started worker."""
        reports, sender = self.context.Pipe(duplex=False)
        process = self.context.Process(
            target=work, args=(self.execute, spec, self.store, sender), name=spec.title, daemon=True
        )
        with sender:
            process.start()
        return _Worker(spec, claim, process, reports, heard=time.monotonic())

    def _listen(self) -> None:
        """Wait until workers report or end, or it is time to look elsewhere."""
        now = time.monotonic()
        limits = [worker.heard + self.timeout - now for worker in self.running if self.timeout is not None]
        if self.waiting and len(self.running) < self.workers:
            limits.append(LOOK_EVERY)
        handles: list[Any] = [worker.process.sentinel for worker in self.running]
        handles += [worker.reports for worker in self.running if not worker.reports.closed]
        ready = wait(handles, max(0.0, min(limits)) if limits else None)
        for worker in self.running:
            worker.ended = worker.process.sentinel in ready  # asked before its last words are read
            self._hear(worker)
            if self.timeout is not None and not worker.ended and time.monotonic() > worker.heard + self.timeout:
                worker.process.kill()
                worker.failure = f"no progress for {self.timeout:g} s at {worker.simulated:g} tu"
                worker.ended = True

    def _hear(self, worker: _Worker) -> None:
        """Read all that a worker has reported."""
        while not worker.reports.closed and worker.reports.poll():
            try:
                report = worker.reports.recv()
            except (EOFError, OSError):  # it ended, perhaps in the middle of a report
                worker.reports.close()
                return
            worker.started, worker.heard = True, time.monotonic()
            if isinstance(report, float):
                worker.simulated = report
            elif isinstance(report, str):
                worker.failure = report
            else:
                raise OSError(*report)

    def _finish(self, worker: _Worker) -> None:
        """Take in the run of a worker that has ended, or note why there is none."""
        spec = worker.spec
        worker.process.join()
        record = self.store.read(spec)
        if record is not None:
            self.records[spec.key] = record
            self.computed += 1
            self.store.absolve(spec)
        elif not worker.started and worker.process.exitcode == 1:
            raise RuntimeError(
                "workers cannot start (their message is on standard error); "
                'does the script that calls run_all lack its `if __name__ == "__main__":`?'
            )
        else:
            self._fail(spec, worker.failure or _ending(worker.process.exitcode))
        self.running.remove(worker)
        self._part(worker)

    def _fail(self, spec: RunSpec, reason: str) -> None:
        """Try a run again, later, or give it up."""
        reasons = self.failures[spec.key]
        reasons.append(reason)
        if len(reasons) < TRIES:
            self.waiting.append(spec)
        else:
            self.store.quarantine(spec, reasons)
            self.quarantined[spec.key] = Quarantined(spec, tuple(reasons))

    def _part(self, worker: _Worker) -> None:
        """Give back what a worker that has ended held."""
        worker.process.join()
        worker.process.close()
        worker.reports.close()
        worker.claim.release()


@contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Put Ctrl-C off until the block has ended; processes started in it never see one.

    The mask is for those, who inherit it. It does not protect this process: a library's thread takes the signal
    instead, and Python then interrupts the main thread wherever that is. So the handler waits, too.
    """
    unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    missed: list[int] = []
    is_main = threading.current_thread() is threading.main_thread()  # no other one is ever interrupted
    handler = signal.signal(signal.SIGINT, lambda number, _: missed.append(number)) if is_main else None
    try:
        yield
    finally:
        if is_main:
            signal.signal(signal.SIGINT, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        if missed:
            signal.raise_signal(signal.SIGINT)


def _ending(code: int | None) -> str:
    """How a process ended, in words."""
    if code is not None and code < 0:
        return f"killed by {signal.Signals(-code).name}"
    return f"ended with exit code {code} and left no record"
