"""Networks in crowds that matter: lines of up to four cubes in a narrow tank, and pairs whose volume changes."""

from dataclasses import replace

import numpy as np
from known_systems import network

from kinetics.assembly import RuleBook, derive
from kinetics.network import Crowding, Network, Tank
from kinetics.rates.breaks import Expansion, break_model, is_break
from kinetics.rates.crowding import ConvexBodies, crowding_in, crowding_model

NARROW = Tank((0.9, 1.0, 1.1))


def crowded_line(tank: Tank = NARROW, rate: float = 0.02) -> Network:
    """The line of four with breaks by bodies and by walls, and joins, that the crowd makes more frequent."""
    derived, model = derive(RuleBook.load("line4")), break_model("collision-wall")
    found = Expansion.of(derived.network, model)
    bodies = ConvexBodies.of(derived.structures.values(), 0.15)
    choice = {
        "bodies": (crowding_model("hard-bodies"), {}),
        "walls": (crowding_model("three-body"), {"third": 2.0}),
        "joins": (crowding_model("linear"), {"c": 0.4}),
    }
    coefficients = np.where(is_break(derived.network), 0.04 * rate, rate)
    constants = found.constants(coefficients, model.weights(derived.network, {"alpha": 1.3, "wall": 9.0}))
    return replace(found.network.with_rates(constants), crowding=crowding_in(found, bodies, tank, choice))


def hits_alone(net: Network) -> Network:
    """The same network, but only breaks have factors, as calibrations of the mechanics find."""
    assert net.crowding is not None
    table = net.crowding.coefficients.copy()
    table[net.stoichiometry.sum(axis=1) < 0] = np.eye(1, table.shape[1])
    return replace(net, laws={}, crowding=Crowding(net.crowding.weights, net.crowding.volumes, table))


LINE = hits_alone(crowded_line())
JOINING = crowded_line()
# Neither s nor phi is conserved; one channel of the crowd has a twin that it does not change, and one none at all.
SWELLING = replace(
    network(
        ("A", "AA"),
        {
            "pair": ((2, 0), (0, 1)),
            "part": ((0, 1), (2, 0)),
            "hit": ((1, 1), (3, 0)),
            "hit by pairs": ((0, 2), (2, 1)),
        },
        [0.05, 0.2, 0.02, 0.03],
    ),
    conserved={"parts": [1, 2]},
    crowding=Crowding([0.01, 0.03], [0.01, 0.05], [[0.5, 0.5, 3.0], [1.0, 0.0, 0.0], [0.0, 1.0, 9.0], [1.0, 0.5, 0.0]]),
)
