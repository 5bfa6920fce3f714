"""Cost of exact sampling on the paper's line: events a second, beside other packages in the same run.

    pip install 'wellmixed[peers]'
    python -m tests.benchmarks.bench_ssa

Processor time, child processes included, median of interleaved repeats; ratios are medians over the pairs. Apart: the
first call, with loading or compiling the kernels, and what each peer takes to build its model, the first time with its
import. A peer that is not installed is left out; so is one whose mean final counts differ from ours by more than 5
standard errors.
"""

from __future__ import annotations

from functools import partial

import click
import numpy as np

from tests.benchmarks.ssa_peers import installed, versions
from tests.benchmarks.ssa_timing import cpu_seconds, print_race, race
from tests.benchmarks.ssa_workloads import paper_line

REPEATS = 7
N_TIMES = 101
CHECK_SEED = 1000  # apart from the seeds of the race
MOST_ERRORS = 5.0
# cubes; runs one by one; runs in lockstep; runs of the peers, fewer of rebop, which wraps every run in a data set
WORKLOADS = ((60, 1000, 1000, 1000), (6_000, 20, 640, 20), (60_000, 5, 64, 5))


def main() -> None:
    """Print the tables."""
    from kinetics import simulate
    from kinetics.sampling import Direct, Lockstep

    click.echo("\n".join(versions()))
    network, start, end = paper_line(60)
    times = np.linspace(0.0, end, N_TIMES)
    for method in (Direct(), Lockstep()):
        began = cpu_seconds()
        simulate(network, method, start, times, runs=20, threads=1)
        click.echo(f"first call of {method.name}: {cpu_seconds() - began:.2f} s CPU")
    for cubes, singles, many, of_peers in WORKLOADS:
        network, start, end = paper_line(cubes)
        events = np.mean([Direct().sample_path(network, start, end, 1, run).times.size for run in range(min(20, many))])

        def ours(method, runs, seed, network=network, start=start):
            return simulate(network, method, start, times, runs=runs, seed=seed, threads=1)

        contestants = {
            "ssa": (partial(ours, Direct(), singles), singles),
            "lockstep": (partial(ours, Lockstep(), many), many),
        }
        expected = ours(Lockstep(), many, CHECK_SEED).counts[:, -1]
        notes = []
        for name, make in installed().items():
            runs = min(of_peers, 20) if name == "rebop" else of_peers
            began = cpu_seconds()
            run = make(network, start)
            built = cpu_seconds() - began
            off = errors_apart(expected, run(end, N_TIMES, runs, CHECK_SEED))
            notes.append(f"  {name:16}  model in {built:5.2f} s CPU; means within {off:.1f} standard errors of ours")
            if off <= MOST_ERRORS:
                contestants[name] = (partial(run, end, N_TIMES, runs), runs)
            else:
                notes[-1] += ": NOT TIMED"
        costs = race({name: call for name, (call, _) in contestants.items()}, REPEATS)
        per_event = {name: cost / (contestants[name][1] * events) for name, cost in costs.items()}
        print_race(f"{cubes:,} cubes, {N_TIMES} times, {events:.0f} events a run", per_event, ("ssa", "lockstep"))
        click.echo("\n".join(notes))


def errors_apart(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest difference of the mean counts of two samples (runs, S), in standard errors from both samples' spread."""
    n, m = len(ours), len(theirs)
    squares = ((ours - ours.mean(axis=0)) ** 2).sum(axis=0) + ((theirs - theirs.mean(axis=0)) ** 2).sum(axis=0)
    error = np.sqrt(squares / (n + m - 2) * (1 / n + 1 / m))
    apart = np.abs(ours.mean(axis=0) - theirs.mean(axis=0))
    return float(np.divide(apart, error, out=np.where(apart > 0, np.inf, 0.0), where=error > 0).max())


if __name__ == "__main__":
    main()
