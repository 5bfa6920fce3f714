"""Networks on which every sampler is held against the exact law: name, network, initial state, times."""

from __future__ import annotations

import numpy as np
from known_systems import decay, line, network, switch, walk

from kinetics.network import Network


def random_network(seed: int) -> tuple[Network, list[int]]:
    """Four species, six reactions of up to three molecules each way that keep their number."""
    rng = np.random.default_rng(seed)
    reactions, rates = {}, []
    while len(reactions) < 6:
        order = rng.integers(1, 4)
        before, after = (rng.multinomial(order, np.full(4, 0.25)) for _ in range(2))
        if (before != after).any():
            reactions[f"r{len(reactions)}"] = (before, after)
            rates.append(float(10.0 ** rng.uniform(-1, 1) / 4.0 ** (order - 1)))
    return network("ABCD", reactions, rates), [5, 3, 2, 1]


def dimers(combinations: str = "distinct") -> Network:
    """2 A <-> B."""
    return network("AB", {"join": ((2, 0), (0, 1)), "part": ((0, 1), (2, 0))}, [0.1, 0.5], combinations)


def enzyme() -> Network:
    """E + S <-> C -> E + P."""
    reactions = {
        "bind": ((1, 1, 0, 0), (0, 0, 1, 0)),
        "free": ((0, 0, 1, 0), (1, 1, 0, 0)),
        "make": ((0, 0, 1, 0), (1, 0, 0, 1)),
    }
    return network("ESCP", reactions, [0.5, 1.0, 0.3])


def epidemic() -> Network:
    """S + I -> 2 I, I -> R."""
    return network("SIR", {"catch": ((1, 1, 0), (0, 2, 0)), "heal": ((0, 1, 0), (0, 0, 1))}, [0.05, 0.6])


def trimers() -> Network:
    """3 A <-> B, and A <-> C."""
    reactions = {
        "join": ((3, 0, 0), (0, 1, 0)),
        "part": ((0, 1, 0), (3, 0, 0)),
        "turn": ((1, 0, 0), (0, 0, 1)),
        "back": ((0, 0, 1), (1, 0, 0)),
    }
    return network("ABC", reactions, [0.02, 0.3, 1.0, 2.0])


def decades() -> Network:
    """Channels with rates six decades apart."""
    reactions = {"ab": ((1, 0, 0), (0, 1, 0)), "ba": ((0, 1, 0), (1, 0, 0)), "leak": ((0, 1, 0), (0, 0, 1))}
    return network("ABC", reactions, [100.0, 100.0, 1e-4])


FEW = (
    ("decay", decay(), [30], [0.2, 1.0]),
    ("switch", switch(1.0, 2.0), [12, 0], [0.3, 2.0]),
    ("line of four", line(), [16, 0, 0, 0], [60.0, 500.0]),
    ("dimers", dimers(), [17, 0], [0.5, 4.0]),
    ("trimers", trimers(), [14, 0, 0], [0.4, 3.0]),
    ("enzyme", enzyme(), [3, 12, 0, 0], [1.0, 6.0]),
)
MANY = (
    *FEW,
    ("epidemic", epidemic(), [30, 2, 0], [1.0, 5.0]),
    ("walk", walk(6), [1, 0, 0, 0, 0, 0, 0], [1.0, 10.0]),
    ("ordered pairs", dimers("ordered"), [17, 0], [0.5, 4.0]),
    ("squares", dimers("product"), [17, 0], [0.5, 4.0]),
    ("decades", decades(), [8, 0, 0], [0.01, 5.0]),
    ("literal line", line("table3_literal"), [16, 0, 0, 0], [60.0, 500.0]),
    *((f"random {seed}", *random_network(seed), [0.05, 0.4]) for seed in range(20)),
)
