"""Campaigns on the disk of one study: kill -9, failing calls, power failures and hangs, at every call."""

from __future__ import annotations

import errno
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from tests.faults.known_studies import Mutant, Study, kept
from tests.faults.layer import DEAD, FAIL, HALF, HANG, KILL, Fault, read_trace
from tests.faults.power import Disk, Tree, put

HUNG_AFTER = 3.0  # s without progress


@dataclass(frozen=True)
class Try:
    """One fault; `losses` makes it happen in an empty folder and says what is wrong afterwards.

    kind : tries of one kind are alike; where there is no time for all, each kind has its turn
    """

    label: str
    kind: str
    losses: Callable[[Path], list[str]]


Plan = Callable[[Path, Mutant], list[Try]]


def calls(study: Study, scratch: Path, mutant: Mutant) -> list[tuple[str, str]]:
    """Name and process of every call of the study, undisturbed."""
    study.struck(scratch / "undisturbed", None, mutant)
    trace = read_trace(scratch / "undisturbed" / "trace")
    return [(event[1], event[2]) for event in trace if event[0] == "call"]


def strike(study: Study, mutant: Mutant, fault: Fault, scratch: Path) -> list[str]:
    """Strike at one call, and give the same command again."""
    first, _ = study.struck(scratch, fault, mutant)
    found = study.check(first)
    return found + study.losses(scratch / "disk" / "a" / "runs", kept(scratch / "trace"), scratch, mutant)


def kills(scratch: Path, mutant: Mutant) -> list[Try]:
    """Kill -9 before every call, and in the middle of every write."""
    study = Study.small()
    made = calls(study, scratch, mutant)
    return [
        Try(f"{kind} at call {at}, {name}", name, partial(strike, study, mutant, Fault(kind, at)))
        for at, (name, _) in enumerate(made, 1)
        for kind in ((KILL, HALF) if name == "write" else (KILL,))
    ]


def failures(scratch: Path, mutant: Mutant) -> list[Try]:
    """No space at every call that takes some, and a failing disk at every call, once or for good."""
    study = Study.small()
    made = calls(study, scratch, mutant)
    return [
        Try(
            f"{errno.errorcode[error]}, {kind}, at call {at}, {name}",
            f"{name}, {kind}",
            partial(strike, study, mutant, fault),
        )
        for at, (name, _) in enumerate(made, 1)
        for error in ((errno.ENOSPC, errno.EIO) if name in ("open", "mkdir", "write", "rename") else (errno.EIO,))
        for kind in (FAIL, DEAD)
        for fault in (Fault(kind, at, error),)
    ]


def hangs(scratch: Path, mutant: Mutant) -> list[Try]:
    """A worker that never comes back from a call."""
    study = replace(Study.small(1), timeout=HUNG_AFTER)
    made = calls(study, scratch, mutant)
    driver = made[0][1]
    return [
        Try(f"hang at call {at}, {name}", name, partial(strike, study, mutant, Fault(HANG, at)))
        for at, (name, process) in enumerate(made, 1)
        if process != driver
    ]


def power_failures(scratch: Path, mutant: Mutant) -> list[Try]:
    """Every state that a power failure may leave, each once."""
    study = Study.small(1)
    study.struck(scratch / "undisturbed", None, mutant)
    disk, promised = Disk(scratch / "undisturbed" / "disk"), []
    found: dict[str, Try] = {}
    for at, event in enumerate(read_trace(scratch / "undisturbed" / "trace"), 1):
        disk.apply(event)
        if event[0] == "kept":
            promised.append(event[1])
        for case, tree in disk.states().items():
            state = hashlib.sha256(repr((sorted(tree.items()), promised)).encode()).hexdigest()
            cut = partial(_lose_power, study, mutant, tree, tuple(promised))
            found.setdefault(state, Try(f"power lost after note {at}, {event[0]}: {case}", case, cut))
    return list(found.values())


def _lose_power(study: Study, mutant: Mutant, tree: Tree, promised: tuple[str, ...], scratch: Path) -> list[str]:
    put(tree, scratch / "disk")
    return study.losses(scratch / "disk" / "a" / "runs", promised, scratch, mutant)
