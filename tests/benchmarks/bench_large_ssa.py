"""Cost of exact sampling of networks with thousands of channels, beside other packages in the same run.

    python -m tests.benchmarks.bench_large_ssa

Processor time, median of interleaved repeats; ratios are medians over the pairs. Building is given apart: making our
network, its fingerprint, and the method's own tables. Peers that are not installed are left out, see `ssa_peers`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial

import click
import numpy as np

from kinetics.network import Network
from kinetics.sampling.base import stream_key
from kinetics.sampling.run_source import Sampler
from kinetics.sampling.watch import Watch
from tests.benchmarks.published_networks import receptor
from tests.benchmarks.ssa_peers import installed
from tests.benchmarks.ssa_timing import print_race, race
from tests.benchmarks.ssa_workloads import Workload, polymer, tanks_in_a_row

REPEATS = 5


def receptor_of_three_sites() -> Workload:
    """Of the size of the published egfr network; made here."""
    model, end = receptor(3)
    return model.network, model.initial, end


# title, network, longer runs than its own by this factor, our methods, peers that finish in seconds
WORKLOADS = (
    ("polymer, 5,000 channels", polymer, 10.0, ("partial", "rejection"), ("bngsim", "bioscrape")),
    ("receptor, 434 species, 3,888 channels", receptor_of_three_sites, 1.0, ("partial", "rejection"), ("bngsim",)),
    ("1,040 tanks, 10,398 channels", lambda: tanks_in_a_row(1040), 1.0, ("rejection",), ("bngsim",)),
    ("4,000 tanks, 39,998 channels", lambda: tanks_in_a_row(4000), 1.0, ("rejection",), ("bngsim",)),
)


def main() -> None:
    """Print the tables."""
    for title, make, factor, ours, peers in WORKLOADS:
        began = time.process_time()
        network, start, end = make()
        click.echo(f"\n{title}: network in {time.process_time() - began:.3f} s CPU", nl=False)
        began = time.process_time()
        _ = network.fingerprint
        click.echo(f", fingerprint in {time.process_time() - began:.3f}")
        compare(network, start, end * factor, ours, peers)


def compare(network: Network, start: np.ndarray, end: float, ours: Sequence[str], peers: Sequence[str]) -> None:
    """One table."""
    from kinetics.sampling import SAMPLING_METHODS, Auto

    click.echo(f"  auto: {Auto().choose(network, start).name}")
    methods = {method.name: method() for method in SAMPLING_METHODS}
    contestants: dict[str, Callable[[int], object]] = {}
    events = {}
    for name in ours:
        method = methods[name]
        began = time.process_time()
        sampler = method.sampler(network)
        click.echo(f"  {name}: tables in {time.process_time() - began:.3f} s CPU")
        contestants[name] = partial(final_state, sampler, network.state(start), end)
        events[name] = np.mean([method.sample_path(network, start, end, seed).times.size for seed in (1, 2, 3)])
    for name in peers:
        if name in installed():
            began = time.process_time()
            run = installed()[name](network, start)
            click.echo(f"  {name}: model in {time.process_time() - began:.2f} s CPU")
            contestants[name] = partial(run, end, 2, 1)
            events[name] = events[ours[0]]
    costs = race(contestants, REPEATS)
    print_race(f"  {events[ours[0]]:,.0f} events", {name: costs[name] / events[name] for name in costs}, ours)


def final_state(sampler: Sampler, start: np.ndarray, end: float, seed: int) -> np.ndarray:
    """Of one run; the tables are there."""
    out = np.empty((1, 1, start.size), dtype=np.int64)
    watch = Watch(np.array([end]), max_events=10**15)
    sampler.ensemble(start, watch.grid, stream_key(seed), 0, out, watch)
    return out


if __name__ == "__main__":
    main()
