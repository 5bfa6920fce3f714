"""Executor on a Dask cluster, whose workers share the disk of the store.

Each worker makes a run in a process of its own, as `Processes` does: a run that crashes costs nobody else a try, and
one that hangs is ended there. Dask gives the runs out, and once more where a whole worker is lost. Its own settings are
right as they are: without `worker-saturation` or with fewer `allowed-failures`, runs that merely waited on a lost
worker would take the blame.
"""

from __future__ import annotations

import multiprocessing
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from platform import node
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, ClassVar
from uuid import uuid4

from mechsim.runs.executors.base import LOOK_EVERY, Execute, Executor, RunAttempt, Session, check_timeout
from mechsim.runs.executors.processes import Processes, ProcessSession

if TYPE_CHECKING:
    from distributed import Client, Future

    from mechsim.runs.record import RunSpec
    from mechsim.runs.store import Claim, RunStore

ANSWER_WITHIN = 5.0  # s, for a scheduler
SEEN_WITHIN = 60.0  # s; a network disk may show a file of another machine only when its cache has run out

# In the process of a Dask worker: sessions at work by the call of `run_all` they belong to, and calls that are over.
_at_work: dict[str, list[ProcessSession]] = {}
_over: set[str] = set()


@dataclass(frozen=True)
class Dask(Executor):
    """An executor on a Dask cluster, whose workers share the store's disk and have the same versions installed.

    address : address of the scheduler, as tcp://10.0.0.5:8786
    timeout : time without progress after which a run counts as hung, s; None: never

    It needs the extra `dist`. OSError: no scheduler answers, when runs are to start

    >>> from mechsim import Dask
    >>> executor = Dask("tcp://10.0.0.5:8786", timeout=600.0)
    >>> executor.address, executor.timeout
    ('tcp://10.0.0.5:8786', 600.0)
    >>> run_all(specs, store, workers=executor)  # doctest: +SKIP
    """

    address: str
    timeout: float | None = None

    option: ClassVar[str] = "--scheduler"
    metavar: ClassVar[str | None] = "ADDRESS"
    kind: ClassVar[Any] = str
    help: ClassVar[str] = (
        "Make runs on the workers of the Dask cluster whose scheduler is at this address, as tcp://10.0.0.5:8786; they "
        "must see the runs folder under the same name."
    )

    def __post_init__(self) -> None:
        check_timeout(self.timeout)

    @classmethod
    def from_option(cls, value: Any, timeout: float | None) -> Dask:
        """The executor for `--scheduler tcp://10.0.0.5:8786`."""
        return cls(value, timeout)

    def check(self) -> None:
        """OSError where no scheduler answers; ModuleNotFoundError where Dask is not installed."""
        self._connect().close()

    def open(self, store: RunStore, execute: Execute) -> ClusterSession:
        """Connect to the scheduler."""
        client = self._connect()
        if not client.nthreads():
            warnings.warn(f"the scheduler at {self.address} has no workers yet; runs wait for one", stacklevel=3)
        return ClusterSession(self, client, store, execute)

    def _connect(self) -> Client:
        import asyncio

        from distributed import Client

        try:
            # In a thread of its own, since a notebook has a loop that runs in this one.
            with ThreadPoolExecutor(1) as thread:
                kind = thread.submit(asyncio.run, _identity(self.address)).result()
        except Exception as error:  # whatever a stranger at that port may send
            raise OSError(
                f"no Dask scheduler answers at {self.address!r}: {str(error) or f'silent for {ANSWER_WITHIN:g} s'}; "
                "expected the address that `dask scheduler` prints, as tcp://10.0.0.5:8786"
            ) from error
        if kind != "Scheduler":
            raise ValueError(f"{self.address} is the address of a Dask {kind.lower()}; expected that of its scheduler")
        return Client(self.address, timeout=ANSWER_WITHIN, set_as_default=False)


async def _identity(address: str) -> str:
    """Kind of the Dask server at this address. The client itself would wait for ever for one that does not answer."""
    import asyncio

    from distributed import Security, rpc

    async def ask() -> str:
        arguments = Security().get_connection_args("client")  # for clusters that speak TLS
        async with rpc(address, timeout=ANSWER_WITHIN, connection_args=arguments) as other:
            return str((await other.identity())["type"])

    return await asyncio.wait_for(ask(), ANSWER_WITHIN)


@dataclass(kw_only=True)
class _Submitted(RunAttempt):
    """A run in the hands of the scheduler; `made` is when a worker said that it is on disk, s."""

    future: Future[Any]
    made: float | None = None


class ClusterSession(Session):
    """Runs that the scheduler has: all that wait, for it knows best when a worker is free."""

    attempts: list[_Submitted]  # type: ignore[assignment]

    def __init__(self, settings: Dask, client: Client, store: RunStore, execute: Execute) -> None:
        super().__init__()
        self.settings, self.client, self.store, self.execute = settings, client, store, execute
        self.call = uuid4().hex
        self.news: SimpleQueue[Future[Any]] = SimpleQueue()

    def has_room(self) -> bool:
        """Always."""
        return True

    def start(self, spec: RunSpec, claim: Claim) -> None:
        """Hand the run to the scheduler. The worker claims it, for it may outlive this process."""
        claim.release()
        arguments = (spec, self.store, self.execute, self.settings.timeout, Path.cwd(), self.call)
        try:
            future = self.client.submit(make, *arguments, key=f"run-{spec.key[:16]}-{uuid4().hex}", pure=False)
        except Exception as error:
            if self.client.status == "running":
                raise
            raise self._gone() from error
        self.attempts.append(_Submitted(spec=spec, future=future))
        future.add_done_callback(self.news.put)

    def listen(self, seconds: float | None) -> None:
        """Take in what workers have said since, and look for the files that they have made."""
        if any(attempt.made is not None for attempt in self.attempts):
            seconds = LOOK_EVERY
        try:
            self._hear(self.news.get(timeout=seconds))
            while True:
                self._hear(self.news.get_nowait())
        except Empty:
            pass
        for attempt in self.attempts:
            if attempt.made is None:
                continue
            path = self.store.path(attempt.spec)
            attempt.ended = path.exists() or path in self.store.folder.iterdir()  # so a network disk is asked anew
            if not attempt.ended and time.monotonic() > attempt.made + SEEN_WITHIN:
                raise OSError(
                    f"a worker has made {path}, which cannot be seen from {node()}; workers must share this folder "
                    "under the same name"
                )

    def _hear(self, future: Future[Any]) -> None:
        """Take in what a worker has said of its run."""
        from distributed import CancelledError, KilledWorker
        from distributed.comm.core import CommClosedError

        attempt = next((attempt for attempt in self.attempts if attempt.future is future), None)
        if attempt is None:
            return
        try:
            said = future.result(timeout=ANSWER_WITHIN)
        except TimeoutError:  # the worker was lost with its answer, and the run is looked at by another one
            future.add_done_callback(self.news.put)
        except KilledWorker as error:
            attempt.failure, attempt.is_last, attempt.ended = _blame(error), True, True
        except (CancelledError, CommClosedError) as error:  # the second where it was lost while it answered
            raise self._gone() from error
        except (OSError, ValueError):  # the run's worker says so
            raise
        except Exception as error:
            raise OSError(
                f"the cluster at {self.settings.address} cannot make runs: {' '.join(str(error).split())}; "
                f"scheduler and workers need the same wellmixed as this machine"
            ) from error
        else:
            if said is None:
                attempt.is_elsewhere = attempt.ended = True
            elif said:
                attempt.failure, attempt.ended = said, True
            else:
                attempt.made, attempt.failure = time.monotonic(), "what a worker has written could not be read"

    def _gone(self) -> OSError:
        return OSError(
            f"the scheduler at {self.settings.address} is gone, or has dropped the runs; finished runs are kept; "
            f"the same command continues from there"
        )

    def close(self) -> None:
        """Call the runs back, end those at work, and leave the cluster."""
        if self.attempts and self.client.status == "running":
            with suppress(OSError):  # the scheduler has just gone; what ended the call is the error to see
                self.client.cancel([attempt.future for attempt in self.attempts])
                self.client.run(end_runs, self.call, on_error="ignore")
        self.client.close()


def make(
    spec: RunSpec, store: RunStore, execute: Execute, timeout: float | None, folder: Path, call: str
) -> str | None:
    """On a worker: make the run in a process of its own and keep it in the store.

    Returns "" once it is on disk, the reason where there is no record, and None where another process has the run.
    Raises what the next run would meet too.
    """
    # Only to be allowed a child; it ends with this process, however that ends (`worker._end_with_driver`).
    multiprocessing.current_process().daemon = False
    claim = store.claim(spec)
    if claim is None:
        return None
    try:
        if store.read(spec) is not None:
            return None
        session = Processes(1, timeout, folder).open(store, execute)
        mine = _at_work.setdefault(call, [])
        mine.append(session)
        try:
            if call in _over:
                return "the command that requested it has ended"
            session.start(spec, claim)
            (attempt,) = session.attempts
            while not attempt.ended:
                session.listen(None)
        finally:
            mine.remove(session)
            session.close()
        return "" if store.path(spec).exists() else attempt.failure
    finally:
        claim.release()


def end_runs(call: str) -> None:
    """On a worker: end all runs of this call."""
    _over.add(call)
    for session in list(_at_work.get(call, [])):
        session.kill()


def _blame(error: Any) -> str:
    """Why Dask has given a run up."""
    lost, last = error.allowed_failures + 1, error.last_worker.address
    return f"{lost} workers of the cluster were lost while they made it, the last {last}"
