"""Network-free runs as paths of a derived network, and paths as network-free runs: two records of the same events."""

from __future__ import annotations

import numpy as np

from kinetics.assembly import Derivation
from kinetics.network import Tank
from kinetics.networkfree.growth import NOTHING, Growth
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Ints


def path_of(growth: Growth, derivation: Derivation, tank: Tank | None = None) -> JumpPath:
    """A network-free run as a path of its book's derived network. Cost: linear in the events.

    tank : where it happened; None where that is not known
    KeyError: a structure or an event that the network does not have.

    >>> from kinetics import ClassRates, grow
    >>> from kinetics.assembly import RuleBook, derive
    >>> from kinetics.networkfree import path_of
    >>> book = RuleBook.load("line4")
    >>> (run,) = grow(book, ClassRates.uniform(join=1e-3), initial=8, end=1e5, seed=1).runs
    >>> path_of(run, derive(book)).states[[0, -1]].tolist()
    [[8, 0, 0, 0], [0, 0, 0, 2]]
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


def growth_of(path: JumpPath, derivation: Derivation) -> Growth:
    """A path of a book's derived network, such as a mechanics run, as a network-free run has it.

    ValueError: a path that was restarted, or of another network.

    >>> from kinetics import Rates, sample_path
    >>> from kinetics.assembly import RuleBook, derive
    >>> from kinetics.networkfree import growth_of
    >>> line = derive(RuleBook.load("line4"))
    >>> path = sample_path(Rates.load("table3").apply(line.network), {"monomer": 8}, end=100.0, seed=1)
    >>> growth_of(path, line).n_cubes
    8
    """
    if path.network.fingerprint != derivation.network.fingerprint:
        raise ValueError(f"a path is not of the network of book {derivation.book.name!r}")
    if (path.channels == RESTART).any():
        raise ValueError("a path that was restarted shows no growth; give runs that were not")
    sides: tuple[Ints, Ints] = (
        np.full((len(derivation.events), 2), NOTHING),
        np.full((len(derivation.events), 2), NOTHING),
    )
    for channel, event in enumerate(derivation.events):
        for table, side in zip(sides, event, strict=True):
            table[channel, : len(side)] = side
    before, after = (table[path.channels] for table in sides)
    structures = tuple(derivation.structures.values())
    return Growth(derivation.book, structures, path.initial, path.times, before, after, path.end, path.times.size)
