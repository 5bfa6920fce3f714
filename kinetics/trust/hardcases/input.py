"""Hard cases of wrong input: what must be refused, with a message that says why."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from kinetics.markov import first_passage
from kinetics.markov.passage import rare_event
from kinetics.markov.transient import Dense, FiniteStateProjection, Transient
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints
from kinetics.trust.hardcases.case import Attempt, Case, network, refusal


def _copies(states: Ints) -> Floats:
    return states[:, 0].astype(float)


def _rates() -> Iterator[Attempt]:
    for bad, expected in ((np.nan, "finite"), (np.inf, "finite"), (-1.0, "at least 0")):
        yield refusal(f"network, rate {bad}", partial(network, {"death": ({"X": 1}, {}, bad)}), expected)


def _counts() -> Iterator[Attempt]:
    net = network({"death": ({"X": 1}, {}, 1.0)})
    for bad, expected in ((0.5, "whole numbers"), (-1, "at least 0"), (2.0**63, "largest count"), (np.nan, "whole")):
        yield refusal(f"state, {bad:g} copies", partial(net.state, [bad]), expected)
    yield refusal("state, unknown species", partial(net.state, {"Y": 1}), "unknown species")
    sides: Any = {"turn": ({"X": 1}, {"Z": 1})}
    unknown = partial(Network.from_reactions, sides, [1.0], ("X", "Y"))
    yield refusal("network, unknown species", unknown, "unknown species 'Z'")
    for bad, expected in ((1.5, "whole"), (-1, "at least 0")):
        copies: Any = {"turn": ({"X": bad}, {})}
        yield refusal(f"network, {bad} copies", partial(Network.from_reactions, copies, [1.0]), expected)


def _overdraft() -> Iterator[Attempt]:
    taking: Any = (("eat",), [[0]], [[-1]], [1.0], [1.0])
    yield refusal("network, consumption at a constant rate", partial(Network, ("X",), *taking), "needs only 0")
    doubled: Any = (("a",), [[1, 0]], [[-1, 0]], [1.0], [1.0])
    yield refusal("network, a species twice", partial(Network, ("X", "X"), *doubled), "twice")


def _limits() -> Iterator[Attempt]:
    growth = network({"birth": ({}, {"X": 1}, 1.0)})
    switch = network({"ab": ({"A": 1}, {"B": 1}, 1e8), "ba": ({"B": 1}, {"A": 1}, 1e8)})
    yield refusal(
        "transient, infinite space", lambda: Transient(max_states=5000).solve(growth, [0], [1.0]), "and rising"
    )
    yield refusal(
        "fsp, too many states", lambda: FiniteStateProjection(max_states=50).solve(growth, [0], [90.0]), "matter"
    )
    yield refusal(
        "passage, infinite space", lambda: first_passage(growth, [0], "X", 10**7, max_states=5000), "reachable"
    )
    yield refusal("exact, tolerance 1e-30", lambda: Transient(tolerance=1e-30), "tolerance")
    yield refusal("fsp, tolerance 1e-16", lambda: FiniteStateProjection(1e-16), "tolerance")
    yield refusal("rare event, no way", partial(rare_event, switch, [1, 0], _copies, 2, 1e-9, 200), "was not reached")
    yield refusal("transient, too stiff and large", lambda: Transient().solve(switch, [2500, 0], [1e9]), "too stiff")
    yield refusal("dense, rate * time beyond numbers", lambda: Dense().solve(switch, [1, 0], [1e200]), "beyond what")
    yield refusal(
        "transient, too much memory", lambda: Transient().solve(switch, [99_999, 0], np.arange(1e6)), "GB of memory"
    )


INPUT = (
    Case("bad rates", "not a number, infinite, negative", "a refusal", _rates),
    Case("bad counts", "fractions, negative, beyond int64, unknown", "a refusal", _counts),
    Case("overdraft", "a channel that could make a count negative", "a refusal", _overdraft),
    Case("beyond the limits", "impossible spaces, tolerances, stiffness and memory", "a refusal", _limits),
)
