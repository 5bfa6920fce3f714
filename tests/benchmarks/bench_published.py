"""Cost of exact sampling of networks as they are published, beside bngsim on the same .net file in the same run.

    pip install 'wellmixed[peers]'
    python -m tests.benchmarks.bench_published                          networks made here, of the published classes
    python -m tests.benchmarks.bench_published egfr_net.net=2 fceri.net=10     files, and until when to run each

Processor time, median of interleaved repeats; the ratio is the median over the pairs. Reading a file and making a
sampler's tables are given apart, compiling is not counted. Final states only, one run at a time.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinetics import Auto
from kinetics.formats import read, write
from kinetics.support.tables import text_table
from tests.benchmarks.bench_large_ssa import final_state
from tests.benchmarks.published_networks import multistate, receptor
from tests.benchmarks.ssa_timing import race

REPEATS = 5
MADE = {
    "multistate 8": lambda: multistate(8),
    "multistate 10": lambda: multistate(10),
    "receptor 3": lambda: receptor(3),
    "receptor 4": lambda: receptor(4),
}
TITLES = ("network", "species", "channels", "method", "events", "read", "tables", "ns/event")
PEER_TITLES = ("bngsim: read", "ns/event", "times slower")


def main() -> None:
    """Print the table."""
    with_peer = find_spec("bngsim") is not None
    rows = [row(name, path, end, with_peer) for name, path, end in files(sys.argv[1:])]
    click.echo("reading and tables in s of processor time")
    click.echo(text_table(TITLES + (PEER_TITLES if with_peer else ()), rows))


def files(given: list[str]) -> Iterator[tuple[str, Path, float]]:
    """Name, .net file and time until which to run: those given, or those made here."""
    for text in given:
        path, equals, end = text.rpartition("=")
        if not equals:
            raise click.UsageError(f"{text!r}; expected FILE.net=TIME")
        yield Path(path).stem, Path(path), float(end)
    if given:
        return
    with tempfile.TemporaryDirectory() as folder:
        for name, make in MADE.items():
            model, end = make()
            path = Path(folder) / f"{name}.net"
            write(model, path)
            yield name, path, end


def row(name: str, path: Path, end: float, with_peer: bool) -> tuple[str, ...]:
    """What one network costs."""
    read(path)  # what reading imports
    model, reading = timed(partial(read, path))
    method = Auto(many=False)
    click.echo(f"{name} ...", err=True)
    method.sample_path(model.network, model.initial, 1e-9 * end, 1)  # what it compiles
    sampler, tables = timed(partial(method.sampler, model.network))
    events = np.mean([method.sample_path(model.network, model.initial, end, seed).times.size for seed in (1, 2, 3)])
    contestants: dict[str, Callable[[int], object]] = {
        "auto": partial(final_state, sampler, model.network.state(model.initial), end)
    }
    peer_reading = float("nan")
    if with_peer:
        contestants["bngsim"], peer_reading = timed(partial(peer, path, end))
    costs = {who: seconds / events for who, seconds in race(contestants, REPEATS).items()}
    cells = [name, *(f"{len(part):,}" for part in (model.network.species, model.network.channels))]
    cells += [
        method.choose(model.network, model.initial).name,
        f"{events:,.0f}",
        f"{reading:.2f}",
        f"{tables:.3f}",
        spread(costs["auto"]),
    ]
    if with_peer:
        ratio = float(np.median(costs["bngsim"] / costs["auto"]))
        cells += [f"{peer_reading:.2f}", spread(costs["bngsim"]), f"{ratio:.1f}"]
    return tuple(cells)


def peer(path: Path, end: float) -> Callable[[int], object]:
    """A run of bngsim by its seed."""
    import bngsim

    model = bngsim.Model.from_net(str(path))
    simulator = bngsim.Simulator(model, method="ssa")

    def run(seed: int) -> object:
        model.reset()
        return simulator.run(t_span=(0.0, end), n_points=2, seed=seed + 1)

    return run


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and its processor time, s."""
    began = time.process_time()
    given = call()
    return given, time.process_time() - began


def spread(seconds: np.ndarray) -> str:
    """Median and range, ns."""
    low, middle, high = 1e9 * np.quantile(seconds, [0.0, 0.5, 1.0])
    return f"{middle:.0f} ({low:.0f}-{high:.0f})"


if __name__ == "__main__":
    main()
