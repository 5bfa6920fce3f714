"""CPU time, memory and proven error of the matrix-free solver on the T of five, beside the projection's.

    python -m tests.benchmarks.bench_millions                    # 20, 30 and 40 cubes, with ratios
    python -m tests.benchmarks.bench_millions --cubes 60         # each in a process of its own
    python -m tests.benchmarks.bench_millions --cubes 80 --alone # the matrix-free solver alone

Distribution at 2,000 tu and the probability of a T by 200 tu, from single cubes. Rates are those of `results/t5`, and
2e-5 for the breaks that no run has shown, so that every composition can be reached. Targets: 60 cubes (2.35 million
states) in 120 s and 2 GB, 80 cubes (16.4 million) in 1200 s and 8 GB, error 1e-8.
"""

from __future__ import annotations

import multiprocessing
import resource
import time
from dataclasses import replace
from typing import Any

import click
import numpy as np

LAST, EARLY = 2000.0, 200.0
TOLERANCE = 1e-9


def t_of_five() -> Any:
    """The network of the T of five, with rates above 0 only."""
    from kinetics import Rates
    from kinetics.assembly import RuleBook, derive

    network = Rates.load("results/t5/rates.toml").apply(derive(RuleBook.load("t5")).network)
    known = network.known_rates
    return replace(network, rate_constants=np.where(known > 0.0, known, 2e-5))


def measured(what: str, cubes: int) -> tuple[float, float, float, float, int]:
    """CPU and wall time, s, peak memory, GB, error and states; run in a process of its own."""
    from kinetics import FiniteStateProjection, MatrixFree, reached_by, solve

    network = t_of_five()
    start = {network.species[0]: cubes}
    solve(network, MatrixFree(), {network.species[0]: 5}, [1.0])  # imports
    began, clock = time.process_time(), time.perf_counter()
    if what == "passage":
        (answer,) = reached_by(network, "pentamer >= 1", [EARLY], initial=start)
        error, states = answer.high - answer.low, int(answer.why.split()[0].replace(",", ""))
    else:
        method = MatrixFree(TOLERANCE) if what == "matrix-free" else FiniteStateProjection(TOLERANCE, 4_000_000)
        found = solve(network, method, start, [LAST])
        error, states = found.error, len(found.space)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return time.process_time() - began, time.perf_counter() - clock, memory, error, states


@click.command()
@click.option("--cubes", multiple=True, type=int, default=(20, 30, 40))
@click.option("--alone", is_flag=True, help="Leave the projection out.")
def main(cubes: tuple[int, ...], alone: bool) -> None:
    """Print a row for each number of cubes and method, and the projection's time over that of the matrix-free one."""
    context = multiprocessing.get_context("spawn")
    for number in cubes:
        costs = {}
        for what in ("matrix-free", "passage", *([] if alone else ["fsp"])):
            with context.Pool(1) as pool:
                cpu, wall, memory, error, states = pool.apply(measured, (what, number))
            costs[what] = cpu, memory
            cost = f"{cpu:8.2f} s CPU, {wall:8.2f} s, {memory:6.2f} GB"
            click.echo(f"{number:4} cubes  {what:12} {cost}, error {error:.1e}, {states} states", nl=True)
        if not alone:
            time_ratio, memory_ratio = (costs["fsp"][k] / costs["matrix-free"][k] for k in (0, 1))
            click.echo(f"{number:4} cubes  fsp over matrix-free: CPU {time_ratio:.2f}, memory {memory_ratio:.2f}")


if __name__ == "__main__":
    main()
