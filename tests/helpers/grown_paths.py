"""Network-free runs as paths of their book's derived network."""

from __future__ import annotations

import numpy as np

from kinetics.assembly import Derivation
from kinetics.network import Tank
from kinetics.networkfree.growth import NOTHING, Growth
from kinetics.runs import JumpPath


def path_of(growth: Growth, derivation: Derivation, tank: Tank | None = None) -> JumpPath:
    """A network-free run as a path of its book's derived network. Cost: linear in the events.

    tank : where it happened; None where that is not known
    KeyError: a structure or an event that the network does not have.
    """
    species = [derivation.species_of(structure) for structure in growth.structures]
    initial = np.zeros(len(derivation.network.species), dtype=np.int64)
    np.add.at(initial, species, growth.initial)
    channels = [
        derivation.channel(*([species[s] for s in side if s != NOTHING] for side in sides))
        for sides in zip(growth.before.tolist(), growth.after.tolist(), strict=True)
    ]
    return JumpPath(
        derivation.network, initial, growth.times, np.array(channels, dtype=np.int64), growth.end, tank=tank
    )
