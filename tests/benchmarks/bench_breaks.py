"""What breaks with partners cost: line4 ensembles under collision-wall (24 channels) beside first order (8 channels),
and what a crowd costs: the same channels with factors that change with the counts beside the same without.

    python -m tests.benchmarks.bench_breaks

CPU time an event, the least of five rounds in turn, and its ratio; joins at 600 cubes are scaled by 60 / 600, so that
both tanks assemble at the same pace.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from kinetics.network import Network
from kinetics.rates.breaks import break_model
from kinetics.sampling import Direct, Lockstep, sample_path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from break_studies import TANK, KnownBreaks, by_first_coefficient
from crowded_networks import crowded_line, hits_alone

END, ROUNDS = 2000.0, 5
MODELS = {
    "first-order": KnownBreaks(break_model("first-order"), {}, (5e-5,) * 4),
    "collision-wall": by_first_coefficient(break_model("collision-wall"), {"alpha": 1.3, "wall": 40.0}, 1e-7),
}


def network_of(name: str, cubes: int) -> Network:
    """The network of a break model, its joins scaled to the number of cubes."""
    network = MODELS[name].network(TANK)[1]
    is_join = network.stoichiometry.sum(axis=1) < 0
    return network.with_rates(network.known_rates * np.where(is_join, 60 / cubes, 1.0))


def main() -> None:
    """Print one row a method and number of cubes."""
    grid = np.linspace(0.0, END, 11)
    print(f"{'':24s} {'first order':>12s} {'with walls':>12s} {'ratio':>7s}")
    for cubes, runs in ((60, 4000), (600, 800)):
        compare([network_of(name, cubes) for name in MODELS], grid, cubes, runs)
    print(f"{'':24s} {'no crowd':>12s} {'in a crowd':>12s} {'ratio':>7s}")
    for cubes in (60, 120):
        crowded = hits_alone(crowded_line(TANK, rate=2e-4))
        compare([crowded.uncrowded, crowded], grid, cubes, 4000)


def compare(networks: list[Network], grid: np.ndarray, cubes: int, runs: int) -> None:
    """Print one row a method for two networks."""
    start = [cubes, 0, 0, 0]
    events = [np.mean([sample_path(n, start, END, seed=1, run=i).times.size for i in range(8)]) for n in networks]
    for method in (Lockstep(), Direct()):
        best = [np.inf, np.inf]
        for round_ in range(ROUNDS + 1):
            for i, network in enumerate(networks):
                begun = time.process_time()
                method.simulate(network, start, grid, runs, 0, 1)
                if round_:  # the first one compiles
                    best[i] = min(best[i], time.process_time() - begun)
        cost = [1e9 * seconds / runs / n for seconds, n in zip(best, events, strict=True)]
        name = f"{method.name}, {cubes} cubes"
        print(f"{name:24s} {cost[0]:9.1f} ns {cost[1]:9.1f} ns {cost[1] / cost[0]:7.2f}")


if __name__ == "__main__":
    main()
