"""Refusing, before it starts, what the memory would not hold."""

from __future__ import annotations

import os
from pathlib import Path

MAX_BYTES = 24 * 2**30


def check_memory(what: str, n_bytes: float, advice: str) -> None:
    """Raise a ValueError where `what` would take more than is free, or more than 24 GB."""
    allowed = min(MAX_BYTES, available_bytes())
    if n_bytes > allowed:
        raise ValueError(
            f"{what} would take {n_bytes / 2**30:.3g} GB of memory, {allowed / 2**30:.3g} GB are free; {advice}"
        )


def available_bytes() -> float:
    """Memory that new work may take; inf where the system does not tell."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration):
        pass
    try:
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError):  # a system without these names
        return float("inf")
