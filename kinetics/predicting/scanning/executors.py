"""Who answers the points of a scan: this process, several on this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from typing import Any

from kinetics.support.packages import extra
from kinetics.support.workers import GUARD, end_while_loading, end_with_parent, leave_signals_to_parent

ANSWER_WITHIN = 10  # s, for a scheduler


@contextmanager
def executor_of(workers: int | str) -> Iterator[Executor | None]:
    """An executor for points; None if this process makes them itself. Whatever is not done at the end is dropped.

    workers : number of processes, or the address of a Dask scheduler
    OSError: no scheduler answers at the address. ChildProcessError: a worker ended before it had answered.
    """
    end_while_loading()
    if isinstance(workers, str):
        client = _client(workers)
        try:
            yield client.get_executor(pure=False)
        finally:
            client.close()
    elif workers == 1:
        yield None
    else:
        with _processes(workers) as pool:
            yield pool


def results(
    executor: Executor | None, work: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
) -> Iterator[tuple[int, Any]]:
    """Yield the number and the result of each task, as they come."""
    if executor is None:
        for number, task in enumerate(tasks):
            yield number, work(*task)
        return
    waiting = {executor.submit(work, *task): number for number, task in enumerate(tasks)}
    try:
        for future in as_completed(waiting):
            yield waiting[future], future.result()
    finally:
        for future in waiting:
            future.cancel()


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    """Processes on this machine, which Ctrl-C and errors here end at once."""
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context("forkserver" if sys.platform != "win32" else "spawn")
    began = context.Event()
    pool = ProcessPoolExecutor(workers, context, _begin, (began,))
    try:
        yield pool
        pool.shutdown()
    except BaseException as error:
        for child in set(multiprocessing.active_children()) - before:
            child.kill()
        pool.shutdown(wait=True, cancel_futures=True)
        is_unstarted = isinstance(error, ConnectionError | EOFError) and not began.is_set()  # since Python 3.14
        if not (isinstance(error, BrokenProcessPool) or is_unstarted):
            raise
        raise ChildProcessError(
            "a worker ended before it had answered (killed for want of memory?); answered points are stored, so "
            "start again with fewer workers"
            if began.is_set()
            else f"workers cannot start; {GUARD}"
        ) from None


def _begin(began: Event) -> None:
    """Leave Ctrl-C and SIGTERM to the process that asks, and end with it; arithmetic of one worker takes one core."""
    began.set()
    leave_signals_to_parent()
    end_with_parent()
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"


def _client(address: str) -> Any:
    """A client of the Dask scheduler at an address."""
    distributed = extra("distributed")
    try:
        return distributed.Client(address, timeout=ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise OSError(
            f"no Dask scheduler answers at {address!r}: {error}; expected the address that `dask scheduler` prints, as "
            "tcp://10.0.0.5:8786"
        ) from error
