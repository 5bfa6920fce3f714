"""Networks on which sampling methods are held against each other, each with what can go wrong in one."""

import numpy as np
from known_systems import network

from kinetics.network import Network

ENZYME = network(
    ("E", "S", "ES", "P"),
    {
        "bind": ((1, 1, 0, 0), (0, 0, 1, 0)),
        "part": ((0, 0, 1, 0), (1, 1, 0, 0)),
        "turn": ((0, 0, 1, 0), (1, 0, 0, 1)),
        "leak": ((0, 1, 0, 0), (0, 0, 0, 1)),
    },
    [0.3, 1.0, 0.7, 0.05],
)
# A like pair, an autocatalyst, a channel twice, and one that changes nothing.
MIXED = network(
    ("A", "B", "C"),
    {
        "pair": ((2, 0, 0), (0, 1, 0)),
        "split": ((0, 1, 0), (2, 0, 0)),
        "infect": ((1, 0, 1), (0, 0, 2)),
        "heal": ((0, 0, 1), (1, 0, 0)),
        "heal too": ((0, 0, 1), (1, 0, 0)),
        "idle": ((1, 1, 0), (1, 1, 0)),
    },
    [0.2, 0.4, 0.15, 0.3, 0.2, 5.0],
)
APART = network(  # the same without channels that can be merged
    ("A", "B", "C"),
    {
        "pair": ((2, 0, 0), (0, 1, 0)),
        "split": ((0, 1, 0), (2, 0, 0)),
        "infect": ((1, 0, 1), (0, 0, 2)),
        "heal": ((0, 0, 1), (1, 0, 0)),
        "idle": ((1, 1, 0), (1, 1, 0)),
    },
    [0.2, 0.4, 0.15, 0.5, 5.0],
)
THIRD_ORDER = network(
    ("A", "B"), {"three": ((3, 0), (0, 1)), "both": ((1, 1), (2, 0)), "back": ((0, 1), (3, 0))}, [0.02, 0.05, 0.5]
)
PRODUCTS = network(("A", "B"), {"pair": ((2, 0), (0, 1)), "back": ((0, 1), (2, 0))}, [0.1, 1.0], "product")


def ring(n):
    """Walkers on a ring of n places, one way twice as quick as the other."""
    places = [f"place{i}" for i in range(n)]
    reactions = {f"{i}+": ({places[i]: 1}, {places[(i + 1) % n]: 1}) for i in range(n)}
    reactions |= {f"{i}-": ({places[i]: 1}, {places[i - 1]: 1}) for i in range(n)}
    return Network.from_reactions(reactions, np.repeat([2.0, 1.0], n), species=places)
