"""Cost of exact sampling on the paper's line: events a second, beside other packages in the same run.

    python -m tests.benchmarks.bench_ssa

Processor time, median of interleaved repeats; ratios are medians over the pairs. The first call, with loading or
compiling the kernels, apart. Peers that are not installed are left out, see `ssa_peers`.
"""

from __future__ import annotations

import time

import click
import numpy as np

from tests.benchmarks.ssa_peers import installed
from tests.benchmarks.ssa_timing import print_race, race
from tests.benchmarks.ssa_workloads import paper_line

REPEATS = 7
N_TIMES = 101
# cubes; runs one by one; runs in lockstep; runs of the peers, fewer of rebop, which wraps every run in a data set
WORKLOADS = ((60, 1000, 1000, 1000), (6_000, 20, 640, 20), (60_000, 5, 64, 5))


def main() -> None:
    """Print the tables."""
    from kinetics import simulate
    from kinetics.methods import Direct, Lockstep

    network, start, end = paper_line(60)
    times = np.linspace(0.0, end, N_TIMES)
    for method in (Direct(), Lockstep()):
        began = time.process_time()
        simulate(network, method, start, times, runs=20, threads=1)
        click.echo(f"first call of {method.name}: {time.process_time() - began:.2f} s CPU")
    for cubes, singles, many, of_peers in WORKLOADS:
        network, start, end = paper_line(cubes)
        events = np.mean([Direct().sample_path(network, start, end, 1, run).times.size for run in range(min(20, many))])

        def ours(method, runs, network=network, start=start):
            return lambda seed: simulate(network, method, start, times, runs=runs, seed=seed, threads=1)

        contestants = {"ssa": (ours(Direct(), singles), singles), "lockstep": (ours(Lockstep(), many), many)}
        for name, make in installed().items():
            runs = min(of_peers, 20) if name == "rebop" else of_peers
            run = make(network, start)
            contestants[name] = (lambda seed, run=run, runs=runs, end=end: run(end, N_TIMES, runs, seed), runs)
        costs = race({name: call for name, (call, _) in contestants.items()}, REPEATS)
        per_event = {name: cost / (contestants[name][1] * events) for name, cost in costs.items()}
        print_race(f"{cubes:,} cubes, {N_TIMES} times, {events:.0f} events a run", per_event, ("ssa", "lockstep"))


if __name__ == "__main__":
    main()
