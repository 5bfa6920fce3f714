"""A check of free memory before large work begins."""

from __future__ import annotations

import os
from pathlib import Path

MAX_BYTES = 24 * 2**30
SMALL = 2**22  # bytes; for no more the system is not asked, which takes .1 ms
GROUPS = Path("/sys/fs/cgroup")
# Files of the group of processes that a container or a job is confined to: limit, use, and of the use what is cache
# that gives way. Version 2, then version 1.
GROUP_FILES = (
    ("memory.max", "memory.current", "memory.stat", "inactive_file"),
    ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes", "memory/memory.stat", "total_inactive_file"),
)


def check_memory(what: str, n_bytes: float, advice: str) -> None:
    """Raise ValueError if `what` would take more than is free, or more than 24 GB."""
    if n_bytes <= SMALL:
        return
    allowed = min(MAX_BYTES, available_bytes())
    if n_bytes > allowed:
        raise ValueError(
            f"{what} would take {n_bytes / 2**30:.3g} GB of memory, {allowed / 2**30:.3g} GB are free; {advice}"
        )


def available_bytes() -> float:
    """Memory that new work may take; inf if the system does not say."""
    return min(_machine_bytes(), *(_group_bytes(*files) for files in GROUP_FILES))


def _machine_bytes() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration):
        pass
    try:
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError):  # a system without these names
        return float("inf")


def _group_bytes(limit: str, used: str, details: str, cache: str) -> float:
    """Memory that the control group may still take; inf without a group or limit ("max")."""
    try:
        most, now = (float((GROUPS / name).read_text(encoding="ascii")) for name in (limit, used))
        lines = (GROUPS / details).read_text(encoding="ascii").splitlines()
        return most - now + sum(float(line.split()[1]) for line in lines if line.startswith(f"{cache} "))
    except (OSError, ValueError):
        return float("inf")
