"""Rate laws beyond mass action: expressions in counts and time, the usual ones by name, and events.

>>> from kinetics import Network
>>> from kinetics.network.laws import Event, michaelis_menten
>>> network = Network.from_reactions(
...     {"make": ({}, {"S": 1}), "turn": ({"S": 1}, {"P": 1})},
...     ["k * (1 + 0.5 * sin(2 * pi * t / 24))", michaelis_menten("S", vmax=2.0, K=10.0)],
...     parameters={"k": 3.0},
...     events=[Event("dose", "t >= 50", {"S": "S + 100"})],
... )
>>> network.propensities([10, 0], time=6.0).tolist()
[4.5, 1.0]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.network.laws.events import Event
    from kinetics.network.laws.expression import Expression
    from kinetics.network.laws.named import (
        LAWS,
        hill,
        hill_repression,
        mass_action,
        michaelis_menten,
        periodic,
        steps_in_count,
        steps_in_time,
    )

_HOMES = {
    "kinetics.network.laws.events": ("Event",),
    "kinetics.network.laws.expression": ("Expression",),
    "kinetics.network.laws.named": (
        "LAWS",
        "hill",
        "hill_repression",
        "mass_action",
        "michaelis_menten",
        "periodic",
        "steps_in_count",
        "steps_in_time",
    ),
}

__all__ = [
    "LAWS",
    "Event",
    "Expression",
    "hill",
    "hill_repression",
    "mass_action",
    "michaelis_menten",
    "periodic",
    "steps_in_count",
    "steps_in_time",
]

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
