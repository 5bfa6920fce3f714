"""Processor time of several ways to do the same, taken in turn so that all see the same machine."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Mapping, Sequence

import click
import numpy as np


def cpu_seconds() -> float:
    """Processor time of this process and of its children that have ended: some peers run in one."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def race(contestants: Mapping[str, Callable[[int], object]], repeats: int) -> dict[str, np.ndarray]:
    """Seconds (repeats,) of processor time of each, called with a seed; the first call of each is not counted."""
    costs: dict[str, list[float]] = {name: [] for name in contestants}
    for seed in range(repeats + 1):
        for name, call in contestants.items():
            began = cpu_seconds()
            call(seed)
            costs[name].append(cpu_seconds() - began)
    return {name: np.array(seconds[1:]) for name, seconds in costs.items()}


def print_race(title: str, per_event: Mapping[str, np.ndarray], ours: Sequence[str]) -> None:
    """ns an event of each, with the range of the repeats; and how many times each of ours is quicker."""
    click.echo(f"\n{title}")
    quicker = "".join(f"  {'x ' + name:>10}" for name in ours)
    click.echo(f"  {'':14}  {'ns/event':>9}  {'range':>17}{quicker}")
    for name, seconds in per_event.items():
        low, middle, high = 1e9 * np.quantile(seconds, [0.0, 0.5, 1.0])
        ratios = "".join(f"  {np.median(seconds / per_event[own]):10.2f}" for own in ours)
        click.echo(f"  {name:14}  {middle:9.1f}  {low:7.1f} - {high:7.1f}{ratios}")
