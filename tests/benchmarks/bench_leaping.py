"""Cost of exact leaping: the paper's line at up to 1e10 cubes, beside batss, and the choice of `auto` by counts.

    pip install 'wellmixed[peers]'
    python -m tests.benchmarks.bench_leaping

Processor time, median of interleaved repeats; kernels are loaded before. In the first table, a run to 2,000 tu at
constant density, with its counts then; a peer that is not installed is left out, and one whose final counts are not
ours but for chance is told. In the second, networks with 1e2 to 1e9 copies, some that fall low early, some that grow:
where `auto` chooses leaping for a single run, it should cost no more than `ssa`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import click
import numpy as np

from kinetics.network import Network
from kinetics.sampling.base import stream_key
from kinetics.sampling.watch import Watch
from tests.benchmarks.ssa_peers import PEERS, installed, versions
from tests.benchmarks.ssa_timing import race
from tests.benchmarks.ssa_workloads import Workload, paper_line, ring

REPEATS = 5
CUBES = (60_000, 600_000, 6_000_000, 60_000_000, 600_000_000, 10_000_000_000)
MOST_CUBES = {"ssa": 6e6, "batss": 6e8}  # beyond, a run takes too long here
MOST_EVENTS = 1e7  # of a run of the second table
ALIKE = 8.0  # times the root of the cubes that final counts may differ


def main() -> None:
    """Print both tables."""
    package = PEERS["batss"][1]
    click.echo("\n".join(line for line in versions() if line.startswith(package)))
    line_table()
    choice_table()


def line_table() -> None:
    """CPU s a run of the paper's line."""
    from kinetics.sampling import Auto, Direct, Leaping

    names = ["leaping", "auto", "ssa", *(["batss"] if "batss" in installed() else [])]
    click.echo(f"\n{'cubes':>14}" + "".join(f"  {name:>9}" for name in names) + "  leaping is x times quicker")
    for cubes in CUBES:
        network, start, end = paper_line(cubes)
        methods = {"leaping": Leaping(), "auto": Auto(), "ssa": Direct()}
        ways: dict[str, Callable[[int], np.ndarray]] = {
            name: partial(final, method.sampler(network), start, end) for name, method in methods.items()
        }
        if "batss" in names:
            peer = installed()["batss"](network, start)
            ways["batss"] = lambda seed, peer=peer, end=end: peer(end, 2, 1, seed)[0]
        ways = {name: way for name, way in ways.items() if cubes <= MOST_CUBES.get(name, np.inf)}
        costs = race(ways, REPEATS)
        cells = [f"{np.median(costs[name]):9.2g}" if name in costs else f"{'':>9}" for name in names]
        quicker = [f"{name} {np.median(costs[name] / costs['leaping']):.1f}" for name in names[2:] if name in costs]
        click.echo(f"{cubes:14,}" + "".join(f"  {cell}" for cell in cells) + f"  {', '.join(quicker)}")
        for name in quicker and [each for each in ways if each != "leaping"]:
            if np.abs(ways[name](REPEATS) - ways["leaping"](REPEATS)).max() > ALIKE * np.sqrt(cubes):
                click.echo(f"  {name} does not reach the same counts")


def choice_table() -> None:
    """What `auto` chooses for single runs and ensembles, and what leaping costs in units of `ssa`."""
    from kinetics.sampling import Auto, Direct, Leaping

    click.echo(f"\n{'':28}  {'largest count':>13}  {'auto, one run':>13}  {'many runs':>9}  {'leaping / ssa':>13}")
    worst = 0.0
    for name, network, start, end in spread():
        ways = {method.name: partial(final, method.sampler(network), start, end) for method in (Direct(), Leaping())}
        costs = race(ways, REPEATS)
        ratio = float(np.median(costs["leaping"] / costs["ssa"]))
        single, many = (Auto(each).choose(network, start).name for each in (False, True))
        if single == "leaping":
            worst = max(worst, ratio)
        click.echo(f"{name:28}  {start.max():13,}  {single:>13}  {many:>9}  {ratio:13.3f}")
    click.echo(f"largest ratio where auto chooses leaping: {worst:.2f}")


def spread() -> Iterator[tuple[str, Network, np.ndarray, float]]:
    """Networks, initial counts and ends."""
    for power in range(2, 10):
        n = 10**power
        pace = min(1.0, MOST_EVENTS / n)  # of all that would happen, as much as `ssa` does in a second
        yield "line", *_paced(paper_line(n), pace)
        yield "decay", *_text("A -> 0, 1", {"A": n}, 2.0 * pace)
        yield "dimers", *_text(f"2 A <-> B, {1 / n}, 1", {"A": n}, 2.0 * pace)
        yield "birth and death", *_text(f"0 -> A, {n}\nA -> 0, 1", {"A": n}, 2.0 * pace)
        yield "ring of 4", *_walk(4, n, pace)
        yield "ring of 40", *_walk(40, n // 40 + 1, pace)
        yield "falls to 100, stays", *_text("2 A -> A, 0.01\n0 -> A, 50", {"A": n}, 1e4 if n < MOST_EVENTS else 1.0)
        yield (
            "few copies among many",
            *_text(f"E + S <-> ES, {100 / n}, 1e2\nES -> E + P, 1e2", {"E": 5, "S": n}, 100.0),
        )
        yield "hardly anything happens", *_text(f"A -> B, {20 / n}", {"A": n}, 1.0)
    for end in (5.0, 10.0, 14.0):
        yield "grows from 10", *_text("A -> 2 A, 1", {"A": 10}, end)


def _paced(workload: Workload, pace: float) -> Workload:
    network, start, end = workload
    return network, start, end * pace


def _walk(places: int, copies: int, pace: float) -> Workload:
    network, start, _ = ring(places, copies)
    return network, start, pace


def _text(text: str, initial: dict[str, int], end: float) -> Workload:
    network = Network.from_text(text)
    return network, network.state(initial), end


def final(sampler, start: np.ndarray, end: float, seed: int) -> np.ndarray:
    """Counts (S,) at the end of one run."""
    out = np.empty((1, 1, start.size), dtype=np.int64)
    watch = Watch(np.array([end]), max_events=10**15)
    sampler.ensemble(np.asarray(start), watch.grid, stream_key(seed), 0, out, watch)
    return out[0, 0]


if __name__ == "__main__":
    main()
