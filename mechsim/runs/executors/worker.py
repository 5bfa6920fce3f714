"""The worker process: makes one run, stores it, and reports its progress to the driver."""

from __future__ import annotations

import fcntl
import multiprocessing
import os
import threading
import time
import traceback
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from platform import node

from kinetics.support.workers import leave_signals_to_parent
from mechsim.runs.executors.base import Execute
from mechsim.runs.record import RunSpec
from mechsim.runs.store import RunStore

REPORT_EVERY = 0.25  # s between two reports


def work(execute: Execute, spec: RunSpec, store: RunStore, reports: Connection, folder: Path) -> None:
    """Body of a worker: make the run, keep it, say what went wrong.

    reports : gets 0.0 at once, then now and then the simulated time, tu; text where the run failed; an exception where
        the next run would not fare better
    folder : working directory, for a rule book that is named by a relative path
    """
    leave_signals_to_parent()
    os.dup2(2, 1)  # standard output is the command's own; engines print too
    _end_with_driver()

    def tell(report: object) -> None:
        try:
            reports.send(report)
        except OSError:  # the driver has stopped listening: it is being interrupted, and this run with it
            os._exit(1)

    tell(0.0)
    reported = time.monotonic()

    def progress(simulated: float) -> None:
        nonlocal reported
        if time.monotonic() >= reported + REPORT_EVERY:
            reported = time.monotonic()
            tell(float(simulated))

    try:
        if folder.is_dir():  # a worker on another machine may lack it, and a shipped book does not need it
            os.chdir(folder)
        here = replace(spec)  # its key is computed anew, with the versions and the rule book of this machine
        if here.key != spec.key:
            tell(ValueError(f"{spec.title}: {node()} has {_versions(here)}; the run was requested with others"))
            return
        record = execute(spec, progress)
        try:
            store.write(record)
        except OSError as error:
            tell(OSError(error.errno, error.strerror, error.filename))
    except Exception as error:  # noqa: BLE001 - whatever it is, it goes into the quarantine note
        place = traceback.extract_tb(error.__traceback__)[-1]
        tell(f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})")


def _versions(spec: RunSpec) -> str:
    """The properties of this machine that are part of a run's name."""
    physics = spec.inputs["physics"]
    return ", ".join([f"rules {spec.inputs['rules'][:8]}", *(f"{name} {number}" for name, number in physics.items())])


def _end_with_driver() -> None:
    """End this process at once when its driver is gone, however that was killed.

    The kernel signals the closing of the driver's end of a pipe (SIGIO, which ends a process), even while native code
    holds the interpreter; the thread does the same where SIGIO is ignored.
    """
    driver = multiprocessing.parent_process()
    assert driver is not None  # noqa: S101 - a worker has one

    def watch() -> None:
        driver.join()
        os._exit(1)

    fcntl.fcntl(driver.sentinel, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(driver.sentinel, fcntl.F_SETFL, fcntl.fcntl(driver.sentinel, fcntl.F_GETFL) | os.O_ASYNC)
    threading.Thread(target=watch, daemon=True).start()
