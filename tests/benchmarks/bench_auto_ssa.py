"""The choice of `auto` over a range of networks, beside the quickest method: long single runs, and ensembles.

    python -m tests.benchmarks.bench_auto_ssa

Processor time an event, median of interleaved repeats; networks are made ready before. The aim is a ratio of at most
1.2 to the best in every row.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import click
import numpy as np

from kinetics.sampling.base import stream_key
from kinetics.sampling.run_source import Sampler
from kinetics.sampling.watch import Watch
from tests.benchmarks.ssa_timing import race
from tests.benchmarks.ssa_workloads import Workload, paper_line, polymer, ring, tanks_in_a_row

REPEATS = 5
EVENTS = 20_000  # of a single run, and of all runs of an ensemble, roughly
RUNS = 128
MOST_CHANNELS = 3000  # of networks that methods of small ones are tried on
SPREAD: tuple[tuple[str, Callable[[], Workload]], ...] = (
    ("line, 6,000 cubes", partial(paper_line, 6000)),
    *((f"ring of {n}", partial(ring, n)) for n in (3, 6, 10, 20, 50, 200, 1000)),
    *((f"{n} tanks", partial(tanks_in_a_row, n)) for n in (2, 3, 5, 10, 30, 100, 300, 1040)),
    *((f"polymer to {n}", partial(polymer, n, 50 * n)) for n in (5, 10, 20, 40, 100)),
)


def main() -> None:
    """Print the tables."""
    for many in (False, True):
        click.echo(f"\n{'ensembles' if many else 'single runs'}, ns an event")
        click.echo(f"{'':18}  {'R':>6}  {'auto':>10}  {'its cost':>8}  {'best':>10}  {'its cost':>8}  {'ratio':>5}")
        worst = 0.0
        for name, make in SPREAD:
            worst = max(worst, row(name, make(), many))
        click.echo(f"largest ratio {worst:.2f}")


def row(name: str, workload: Workload, many: bool) -> float:
    """Print what one network costs; how many times more than the best the choice costs."""
    from kinetics.sampling import EXACT_METHODS, Auto, CompositionRejection

    network, start, end = workload
    probe = CompositionRejection()
    events = probe.sample_path(network, start, end / 10, 1).times.size * 10
    end *= EVENTS / max(events, 1) / (RUNS if many else 1)
    methods = [kind() for kind in EXACT_METHODS if many or not kind.is_for_ensembles]
    methods = [method for method in methods if len(network.channels) <= MOST_CHANNELS or not method.is_for_ensembles]
    samplers = {}
    for method in methods:
        try:
            samplers[method.name] = method.sampler(network)
        except ValueError:  # not for this network
            continue
    runs = RUNS if many else 1
    costs = race({key: partial(go, sampler, start, end, runs) for key, sampler in samplers.items()}, REPEATS)
    count = np.mean([probe.sample_path(network, start, end, 1, run).times.size for run in range(min(runs, 8))]) * runs
    per_event = {key: 1e9 * np.median(cost) / count for key, cost in costs.items()}
    chosen = Auto(many).choose(network, start).name
    best = min(per_event, key=per_event.__getitem__)
    ratio = per_event[chosen] / per_event[best]
    click.echo(
        f"{name:18}  {len(network.channels):6}  {chosen:>10}  {per_event[chosen]:8.0f}  {best:>10}  "
        f"{per_event[best]:8.0f}  {ratio:5.2f}"
    )
    return ratio


def go(sampler: Sampler, start: np.ndarray, end: float, runs: int, seed: int) -> None:
    """Final states of some runs."""
    out = np.empty((runs, 1, start.size), dtype=np.int64)
    watch = Watch(np.array([end]), max_events=10**15)
    sampler.ensemble(np.asarray(start), watch.grid, stream_key(seed), 0, out, watch)


if __name__ == "__main__":
    main()
