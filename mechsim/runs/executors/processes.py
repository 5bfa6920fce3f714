"""Executor on this machine, one process per run, so that a crash in the engine costs a single try."""

from __future__ import annotations

import multiprocessing
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import click

from kinetics.support.workers import GUARD
from mechsim.runs.executors.base import LOOK_EVERY, Execute, Executor, RunAttempt, Session, check_timeout

if TYPE_CHECKING:
    from mechsim.runs.record import RunSpec
    from mechsim.runs.store import Claim, RunStore

MOST_LOST_STARTS = 100  # of one run, before we believe that no process will ever start
AWAY = 2.0  # s; we were stopped ourselves (Ctrl-Z, a sleeping machine) where a wait took so much longer than asked

# Ends of processes are read once: two threads of one process (a Dask worker has several) must not both try.
_one_at_a_time = threading.RLock()


@dataclass(frozen=True)
class Processes(Executor):
    """An executor on this machine, with one process per run.

    workers : number of runs made at the same time
    timeout : time without progress after which a run counts as hung, s (allow for compiling kernels); None: never
    folder : working directory of the runs; None: this process's
    ValueError: fewer than one worker, or a timeout that is not above 0

    >>> from mechsim import Processes
    >>> executor = Processes(workers=2, timeout=600.0)  # for run_all(specs, store, workers=executor)
    >>> executor.workers, executor.timeout
    (2, 600.0)
    >>> Processes(workers=0)
    Traceback (most recent call last):
        ...
    ValueError: workers = 0; expected 1 or more
    """

    workers: int = 1
    timeout: float | None = None
    folder: Path | None = None

    option: ClassVar[str] = "--workers"
    metavar: ClassVar[str | None] = "N"
    kind: ClassVar[Any] = click.IntRange(min=1)
    help: ClassVar[str] = "Number of runs made at the same time, as processes on this machine.  [default: 1]"

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ValueError(f"workers = {self.workers}; expected 1 or more")
        check_timeout(self.timeout)

    @classmethod
    def from_option(cls, value: Any, timeout: float | None) -> Processes:
        """The executor for `--workers 4`; with one worker by default."""
        return cls(1 if value is None else value, timeout)

    def check(self) -> None:
        """Do nothing: processes can always be used."""

    def open(self, store: RunStore, execute: Execute) -> ProcessSession:
        """Get ready to start processes."""
        return ProcessSession(self, store, execute)


@dataclass(kw_only=True)
class _Worker(RunAttempt):
    """A process that makes one run."""

    process: ForkServerProcess
    reports: Connection
    heard: float  # s, when it last reported
    started: bool = False


class ProcessSession(Session):
    """Processes at work, each known by its reports and by its end."""

    attempts: list[_Worker]  # type: ignore[assignment]

    def __init__(self, settings: Processes, store: RunStore, execute: Execute) -> None:
        super().__init__()
        self.settings, self.store, self.execute = settings, store, execute
        self.looked = time.monotonic()  # s, when it last listened
        self.folder = Path.cwd() if settings.folder is None else settings.folder
        self.context = multiprocessing.get_context("forkserver")
        # What a run needs is loaded once, in the server that workers are forked from.
        needed = [f"mechsim.runs.executors.{name}" for name in ("worker", "preload")]
        self.context.set_forkserver_preload([execute.__module__, "mechsim.world.world", *needed])

    def has_room(self) -> bool:
        """Are fewer processes at work than there may be?"""
        return len(self.attempts) < self.settings.workers

    def start(self, spec: RunSpec, claim: Claim) -> None:
        """A process for the run."""
        for _ in range(MOST_LOST_STARTS):
            try:
                with _interrupts_wait():  # until we know the process, and the server has all that it needs
                    self.attempts.append(self._worker(spec, claim))
            except (EOFError, ConnectionError) as error:  # the server that workers are forked from was killed: no
                lost = error  # fault of the run, and a new server comes up in a moment
                time.sleep(LOOK_EVERY / 4)
            else:
                return
        raise ChildProcessError(f"workers cannot be started: their server ends at once ({lost!r})") from lost

    def _worker(self, spec: RunSpec, claim: Claim) -> _Worker:
        from mechsim.runs.executors.worker import work  # brings Numba, which no --help waits for

        reports, sender = self.context.Pipe(duplex=False)
        arguments = (self.execute, spec, self.store, sender, self.folder)
        process = self.context.Process(target=work, args=arguments, name=spec.title, daemon=True)
        with sender, _one_at_a_time:
            process.start()
        return _Worker(spec=spec, claim=claim, process=process, reports=reports, heard=time.monotonic())

    def listen(self, seconds: float | None) -> None:
        """Wait until processes report or end, or one has been silent for too long."""
        timeout, looked, asked = self.settings.timeout, self.looked, time.monotonic()
        limits = [] if seconds is None else [seconds]
        limits += [worker.heard + timeout - asked for worker in self.attempts if timeout is not None]
        handles: list[Any] = [worker.process.sentinel for worker in self.attempts]
        handles += [worker.reports for worker in self.attempts if not worker.reports.closed]
        ready = wait(handles, max(0.0, min(limits)) if limits else None)
        self.looked = now = time.monotonic()
        late = now - asked - max(0.0, min(limits)) if limits else 0.0
        was_away = max(asked - looked, late) > AWAY  # before or in the wait; and so were the workers, perhaps
        for worker in self.attempts:
            has_ended = worker.process.sentinel in ready  # asked before its last words are read
            self._hear(worker)
            if was_away:
                worker.heard = now
            if timeout is not None and not has_ended and now > worker.heard + timeout:
                worker.process.kill()
                worker.failure = f"no progress for {timeout:g} s at {worker.simulated:g} tu"
                has_ended = True
            if has_ended:
                code = self._part(worker)
                if not worker.started and code == 1:
                    raise ChildProcessError(f"workers cannot start; {GUARD}")
                worker.failure = worker.failure or _ending(code)

    def _hear(self, worker: _Worker) -> None:
        """Read all that a process has reported."""
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
                raise report

    def _part(self, worker: _Worker) -> int | None:
        """Give back what a process that has ended, or was killed, held; returns its exit code."""
        with _one_at_a_time:
            worker.process.join()
            code = worker.process.exitcode
            worker.process.close()
            worker.ended = True
        worker.reports.close()
        return code

    def kill(self) -> None:
        """End all processes at once; files are written whole or not at all, so nothing needs to be tidied up."""
        for worker in list(self.attempts):
            with _one_at_a_time:
                if not worker.ended:
                    worker.process.kill()

    def close(self) -> None:
        """End all processes, and wait until they are gone."""
        self.kill()
        for worker in self.attempts:
            if not worker.ended:
                self._part(worker)


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
    """How a process ended, for a message."""
    if code is not None and code < 0:
        return f"killed by {signal.Signals(-code).name}"
    return f"ended with exit code {code} and left no record"
