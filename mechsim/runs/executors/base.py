"""Base classes of executors: what the driver of an ensemble requires of whatever makes the runs.

To add an executor: a file with an `Executor` (its settings, and the option of the command line that chooses it) and a
`Session` (the runs it has in hand), and its line in `EXECUTORS`. Claims, tries, the quarantine and the progress bar
stay with the driver.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from mechsim.runs.record import RunRecord, RunSpec
    from mechsim.runs.store import Claim, RunStore

Execute = Callable[["RunSpec", Callable[[float], None]], "RunRecord"]

LOOK_EVERY = 0.2  # s between two looks at what nobody reports: runs claimed by others, files on a network disk


@dataclass(kw_only=True)
class RunAttempt:
    """One attempt to make a run.

    claim : the right to make it, given back by the driver; None: the worker that makes the run claims it
    simulated : simulated time so far, tu, if known
    ended : whether it is over, with a record or a failure
    failure : why there is no record
    is_last : whether another try would do harm
    is_elsewhere : whether there was no try, because another process is making the run or has already made it
    """

    spec: RunSpec
    claim: Claim | None = None
    simulated: float = 0.0
    ended: bool = False
    failure: str = ""
    is_last: bool = False
    is_elsewhere: bool = False


class Session(ABC):
    """The runs that an executor has in progress during one call of `run_all`."""

    def __init__(self) -> None:
        self.attempts: list[RunAttempt] = []  # the driver takes out those that have ended

    @abstractmethod
    def has_room(self) -> bool:
        """Whether another run may be started now."""

    @abstractmethod
    def start(self, spec: RunSpec, claim: Claim) -> None:
        """Begin a try at a run and add it to the attempts; Ctrl-C must not come between the two."""

    @abstractmethod
    def listen(self, seconds: float | None) -> None:
        """Update the attempts once something has happened, or after this many seconds; None: wait as long as it takes.

        Errors that the next run would meet too (a full disk, other versions on a worker) are raised.
        """

    @abstractmethod
    def close(self) -> None:
        """End all runs in progress; after that nothing writes to the store."""


class Executor(ABC):
    """The settings of an executor, which makes the runs of an ensemble.

    option, metavar, kind, help : the option that chooses it on the command line, whose value `from_option` takes
    """

    option: ClassVar[str]
    metavar: ClassVar[str | None]
    kind: ClassVar[Any]
    help: ClassVar[str]

    @classmethod
    @abstractmethod
    def from_option(cls, value: Any, timeout: float | None) -> Executor:
        """The executor for an option on the command line; value None: its default, if it has one."""

    @abstractmethod
    def check(self) -> None:
        """Raise, within seconds and before any work is done, if the executor could not be used."""

    @abstractmethod
    def open(self, store: RunStore, execute: Execute) -> Session:
        """Get ready to make runs; `execute` is called where they are made, so it must be importable by name."""


def check_timeout(timeout: float | None) -> None:
    """ValueError where it is no time."""
    if timeout is not None and not timeout > 0:
        raise ValueError(f"timeout = {timeout}; expected seconds above 0, or none")
