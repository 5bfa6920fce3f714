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
    from kinetics.network.laws.events import Event as Event
    from kinetics.network.laws.expression import Expression as Expression
    from kinetics.network.laws.named import LAWS as LAWS
    from kinetics.network.laws.named import hill as hill
    from kinetics.network.laws.named import hill_repression as hill_repression
    from kinetics.network.laws.named import mass_action as mass_action
    from kinetics.network.laws.named import michaelis_menten as michaelis_menten
    from kinetics.network.laws.named import periodic as periodic
    from kinetics.network.laws.named import steps_in_count as steps_in_count
    from kinetics.network.laws.named import steps_in_time as steps_in_time

__getattr__, __dir__ = lazy_names(__name__)
