"""Stores and executors that are wrong on purpose: the controls, each of which a campaign has to catch."""

from __future__ import annotations

import io
import math
import os
import signal
import stat
from pathlib import Path

from mechsim.runs import file_locks, store
from mechsim.runs.executors import processes
from mechsim.runs.record import RunRecord, RunSpec
from mechsim.runs.store import Claim, RunStore
from tests.faults.known_studies import Mutant


def _written_in_place() -> None:
    """No temporary name: a reader, or a fault, meets half a file."""

    def write(path: Path, data: bytes) -> None:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o666)
        try:
            half = len(data) // 2
            os.write(descriptor, data[:half])
            written = half
            while written < len(data):
                written += os.write(descriptor, data[written:])
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    store.write_locked = write


def _never_synced() -> None:
    os.fsync = lambda descriptor: None


def _names_never_synced() -> None:
    real = os.fsync

    def fsync(descriptor: int) -> None:
        if not stat.S_ISDIR(os.fstat(descriptor).st_mode):
            real(descriptor)

    os.fsync = fsync


def _renamed_before_it_is_synced() -> None:
    def write(path: Path, data: bytes) -> None:
        temporary = path.with_name(f".{path.name}.tmp")
        descriptor = os.open(temporary, file_locks.SHARED, 0o666)
        os.ftruncate(descriptor, 0)
        while data:
            data = data[os.write(descriptor, data) :]
        temporary.replace(path)
        os.fsync(descriptor)
        os.close(descriptor)
        file_locks.sync_folder(path.parent)

    store.write_locked = write


def _everybody_may_claim() -> None:
    def claim(self: RunStore, spec: RunSpec) -> Claim:
        return Claim(self.folder / "claims" / spec.key, io.BytesIO())

    RunStore.claim = claim  # type: ignore[method-assign,assignment]


def _errors_are_swallowed() -> None:
    """As if a run were on disk whatever the disk says."""
    real = RunStore.write

    def write(self: RunStore, record: RunRecord) -> Path:
        try:
            return real(self, record)
        except OSError:
            return self.path(record.spec)

    RunStore.write = write  # type: ignore[method-assign]


def _notes_stay() -> None:
    RunStore.absolve = lambda self, spec: None  # type: ignore[method-assign]


def _sleep_is_not_noticed() -> None:
    processes.AWAY = math.inf


def _hung_runs_are_waited_for() -> None:
    real = processes.ProcessSession.listen

    def listen(self: processes.ProcessSession, seconds: float | None) -> None:
        object.__setattr__(self.settings, "timeout", None)
        real(self, seconds)

    signal.alarm(8)  # s; it is stuck for good
    processes.ProcessSession.listen = listen  # type: ignore[method-assign]


def _any_version_is_read() -> None:
    def made(self: RunStore, folder: str | Path) -> None:
        self.folder = Path(folder).absolute()
        for part in ("claims", "quarantine"):
            (self.folder / part).mkdir(parents=True, exist_ok=True)

    RunStore.__init__ = made  # type: ignore[method-assign]


MUTANTS: dict[str, tuple[str, Mutant]] = {  # what is wrong: the campaign that catches it, and how it is made so
    "runs are written in place": ("kills", _written_in_place),
    "runs are written in place, on a failing disk": ("failures", _written_in_place),
    "errors of the disk are swallowed": ("failures", _errors_are_swallowed),
    "nothing is synced": ("power", _never_synced),
    "names are not synced": ("power", _names_never_synced),
    "a run is renamed before it is synced": ("power", _renamed_before_it_is_synced),
    "notes of runs given up stay": ("kills", _notes_stay),
    "outputs are not synced": ("door", _never_synced),
    "claims bind nobody": ("drivers", _everybody_may_claim),
    "sleep is not noticed": ("clocks", _sleep_is_not_noticed),
    "a hung run is waited for": ("hung runs", _hung_runs_are_waited_for),
    "any version is read": ("versions", _any_version_is_read),
}
