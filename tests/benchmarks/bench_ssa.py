"""Cost of the direct method: events a second, and the ensemble that the issue asks for.

    python -m tests.benchmarks.bench_ssa

CPU time, median of warm repeats; the first call, with loading or compiling the kernel, apart. To be read beside
1,000 runs at 60 cubes and 2,000 tu in 0.1 s, and other tools on a like machine (ns an event, W1 / W2 / W3 here):
bioscrape 654 / 166 / 150, bngsim 1,950 / 86 / 57, rebop 42,100 / 486 / 106.
"""

from __future__ import annotations

import time
from statistics import median

import click
import numpy as np

REPEATS = 7
WORKLOADS = (  # name, cubes, factor on the rates of joins, runs
    ("W1: 60 cubes, 1,000 runs", 60, 1.0, 1000),
    ("W2: 6,000 cubes, 20 runs", 6_000, 1e-2, 20),
    ("W3: 60,000 cubes, 5 runs", 60_000, 1e-3, 5),
)


def main() -> None:
    """Print the table."""
    from kinetics import Direct, Rates, simulate
    from kinetics.assembly import RuleBook, derive

    line = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    times = np.linspace(0.0, 2000.0, 101)
    began = time.process_time()
    simulate(line, Direct(), [60, 0, 0, 0], times, runs=1)
    click.echo(f"first call, with import of numba and loading the kernel: {time.process_time() - began:.2f} s CPU")
    click.echo(f"{'workload (2,000 tu, 101 times)':32}  {'s CPU':>8}  {'events/run':>10}  {'ns/event':>8}")
    for name, cubes, factor, runs in WORKLOADS:
        joins = np.where(line.reactants.sum(axis=1) == 2, factor, 1.0)
        model = line.with_rates(line.rate_constants * joins)
        start = model.state({"monomer": cubes})
        costs = []
        for _ in range(REPEATS):
            began = time.process_time()
            simulate(model, Direct(), start, times, runs=runs, seed=1)
            costs.append(time.process_time() - began)
        events = np.mean(
            [Direct().sample_path(model, start, 2000.0, 1, run).times.size for run in range(min(runs, 50))]
        )
        cost = median(costs)
        click.echo(f"{name:32}  {cost:8.4f}  {events:10.0f}  {cost / runs / events * 1e9:8.0f}")


if __name__ == "__main__":
    main()
