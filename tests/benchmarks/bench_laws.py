"""Cost of rate laws beyond mass action: ns of processor time an event, beside the direct method.

    python -m tests.benchmarks.bench_laws

The same networks, with rate constants and with their laws written out, and laws that depend on the time. One run of
about a million events each; median of five, after one that compiles or loads the kernels.
"""

from __future__ import annotations

import time
from statistics import median

import numpy as np

from kinetics import Direct
from kinetics.network import Network
from kinetics.network.laws import michaelis_menten
from kinetics.sampling import General

BIRTH_DEATH = {"birth": ({}, {"X": 1}), "death": ({"X": 1}, {})}
SCHLOEGL = {
    "up": ({"X": 2}, {"X": 3}),
    "down": ({"X": 3}, {"X": 2}),
    "feed": ({}, {"X": 1}),
    "leak": ({"X": 1}, {}),
}
WRITTEN = ["0.03 * X * (X - 1)", "2e-4 / 6 * X * (X - 1) * (X - 2)", "200", "3.5 * X"]
CASES = (
    ("birth and death", BIRTH_DEATH, [1000.0, 1.0], Direct(), 1000, 500.0),
    ("birth and death", BIRTH_DEATH, [1000.0, 1.0], General(), 1000, 500.0),
    ("birth and death, as laws", BIRTH_DEATH, ["1000", "X"], General(), 1000, 500.0),
    ("death by Michaelis-Menten", BIRTH_DEATH, [1000.0, michaelis_menten("X", 2000.0, 1000.0)], General(), 1000, 500.0),
    ("birth at a changing rate", BIRTH_DEATH, ["1000 * (1 + 0.5 * sin(t))", 1.0], General(), 1000, 500.0),
    (
        "both at changing rates",
        BIRTH_DEATH,
        ["1000 * (1 + 0.5 * sin(t))", "X * (1 + 0.5 * cos(t))"],
        General(),
        1000,
        500.0,
    ),
    ("Schloegl", SCHLOEGL, [0.06, 2e-4, 200.0, 3.5], Direct(), 250, 30.0),
    ("Schloegl", SCHLOEGL, [0.06, 2e-4, 200.0, 3.5], General(), 250, 30.0),
    ("Schloegl, as laws", SCHLOEGL, WRITTEN, General(), 250, 30.0),
)


def nanoseconds_per_event(network: Network, method: Direct | General, initial: int, end: float) -> float:
    """Median processor time of one run over its events."""
    n_events = method.sample_path(network, [initial], end, seed=1).times.size
    spent = []
    for _ in range(5):
        begin = time.process_time()
        method.simulate(network, [initial], [end], runs=1, seed=1, threads=1)
        spent.append(time.process_time() - begin)
    return 1e9 * median(spent) / n_events


def main() -> None:
    """Print the table."""
    print(f"{'network':28} {'method':8} {'ns/event':>9}   numpy {np.__version__}")
    for name, reactions, rates, method, initial, end in CASES:
        network = Network.from_reactions(reactions, rates)
        print(f"{name:28} {method.name:8} {nanoseconds_per_event(network, method, initial, end):9.0f}", flush=True)


if __name__ == "__main__":
    main()
