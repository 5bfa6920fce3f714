"""The base of all models of crowding: how rates of hits and joins depend on the bodies in the tank."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from kinetics.network import Crowding, Tank
from kinetics.rates.breaks import WALL, Expansion, ShapeParameter
from kinetics.rates.crowding.bodies import ConvexBodies
from kinetics.support.arrays import Floats

SourceName = Literal["bodies", "walls", "joins"]
SOURCES: tuple[SourceName, ...] = ("bodies", "walls", "joins")


class CrowdingModel(ABC):
    """A model of crowding: factors on propensities, which are mass action otherwise.

    With s the surface of all bodies over the tank's volume, phi the share of the tank that they fill and
    z = s / (1 - phi), factor = c_0 + (c_1 + c_2 z + c_3 z^2 + ...) / (1 - phi).

    To add a model:
    1. write a class with a `name`, whose docstring states its assumption and its source;
    2. give `terms`, and `parameters` if it has any; `has_room` if walls keep bodies inside;
    3. import it in `kinetics.rates.crowding.models`.

    >>> from kinetics.rates.crowding import crowding_model
    >>> crowding_model("hard-bodies").terms([0.5], {}).round(3).tolist()
    [[0.0, 1.0, 0.5, 0.056]]
    """

    name: ClassVar[str]
    parameters: ClassVar[tuple[ShapeParameter, ...]] = ()
    has_room: ClassVar[bool] = False

    @abstractmethod
    def terms(self, contact: Floats, shape: Mapping[str, float]) -> Floats:
        """Coefficients (n, D) >= 0 of channels whose bodies have contact lengths (n,), see `ConvexBodies.contact`."""


Choice = Mapping[SourceName, tuple[CrowdingModel, Mapping[str, float]]]


def crowding_in(expansion: Expansion, bodies: ConvexBodies, tank: Tank, choice: Choice) -> Crowding:
    """The factors of a network in a tank.

    choice : source -> model and its parameters, for breaks by bodies, breaks by walls and joins; others have no factor

    Breaks that need no partner, and channels of other kinds, have no factor. Cost: linear in channels.

    >>> from dataclasses import replace
    >>> from kinetics import Network, Tank
    >>> from kinetics.rates.breaks import Expansion, break_model
    >>> from kinetics.rates.crowding import ConvexBodies, crowding_in, crowding_model
    >>> pairs = replace(Network.from_text("2 A <-> AA, 0.01, 0.1"), conserved={"cubes": [1, 2]})
    >>> cubes = ConvexBodies([0.11, 0.15], [0.135, 0.225], [0.0034, 0.0068])
    >>> hits = {"bodies": (crowding_model("linear"), {"c": 0.5})}
    >>> broken = Expansion.of(pairs, break_model("collision"))
    >>> crowding_in(broken, cubes, Tank((2.0, 2.0, 3.0)), hits).factors([40, 20]).round(3).tolist()
    [1.0, 1.432, 1.432]
    """
    network, partners = expansion.network, expansion.model.partners(expansion.base)
    found: dict[SourceName, list[list[int]]] = {name: [] for name in SOURCES}
    for channel, p in enumerate(expansion.partner_of.tolist()):
        who, copies = network.sparse_reactants.row(channel)
        pair = np.repeat(who, copies).tolist()
        if p >= 0 and partners[p] == WALL:
            found["walls"].append([channel, *pair, -1])
        elif len(pair) == 2:
            found["bodies" if p >= 0 else "joins"].append([channel, *pair])
    coefficients = np.zeros((len(network.channels), 1))
    coefficients[:, 0] = 1.0
    for name, (model, shape) in choice.items():
        if not found[name]:
            continue
        channels, one, other = np.array(found[name]).T
        at_walls = name == "walls"
        terms = model.terms(bodies.radius[one] if at_walls else bodies.contact(one, other), shape)
        if model.has_room:
            room = bodies.room_at_walls(one, tank) if at_walls else bodies.room_of_pairs(one, other, tank)
            terms = terms * room[:, None]
        more = max(0, terms.shape[1] - coefficients.shape[1])
        coefficients = np.pad(coefficients, ((0, 0), (0, more)))
        coefficients[channels] = 0.0
        coefficients[channels, : terms.shape[1]] = terms
    return Crowding(bodies.surface / tank.volume, bodies.volume / tank.volume, coefficients)
