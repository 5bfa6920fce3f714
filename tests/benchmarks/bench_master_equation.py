"""Cost of the exact solution at 60, 80 and 120 cubes: states, generator, 100 times, and the first passage.

    python -m tests.benchmarks.bench_master_equation

CPU time, median of repeats; nothing here is compiled, and the import of scipy is made before. To be read beside 5 s at
120 cubes and 100 times, and scipy's expm_multiply for ONE time, t = 500, on a like machine: 0.04 / 0.09 / 1.9 s.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

import click
import numpy as np

REPEATS = 5


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """The result, and the median CPU time in seconds."""
    costs = []
    for _ in range(REPEATS):
        began = time.process_time()
        result = work()
        costs.append(time.process_time() - began)
    return result, median(costs)


def main() -> None:
    """Print the table."""
    from kinetics import Rates, Transient, first_passage, reachable, solve
    from kinetics.assembly import RuleBook, derive

    line = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    times = np.linspace(0.0, 2000.0, 101)[1:]
    solve(line, Transient(), [4, 0, 0, 0], times)
    first_passage(line, [4, 0, 0, 0], "quadmer")
    click.echo(
        f"{'cubes':>5}  {'states':>6}  {'explore':>8}  {'generator':>9}  {'solve':>8}  {'passage':>8}  {'error':>8}"
    )
    for cubes in (60, 80, 120):
        start = [cubes, 0, 0, 0]
        space, exploring = timed(lambda start=start: reachable(line, start))
        _, generating = timed(space.generator)
        law, solving = timed(lambda start=start: solve(line, Transient(), start, times))
        _, passing = timed(lambda start=start: first_passage(line, start, "quadmer").quantile([0.025, 0.5, 0.975]))
        click.echo(
            f"{cubes:5}  {len(space):6}  {exploring:7.3f}s  {generating:8.3f}s  {solving:7.3f}s  {passing:7.3f}s  "
            f"{law.error:8.1e}"
        )


if __name__ == "__main__":
    main()
