"""Paths of a derived network, such as mechanics runs, as network-free runs."""

from __future__ import annotations

import numpy as np

from kinetics.assembly import Derivation
from kinetics.networkfree.growth import NOTHING, Growth
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Ints


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
        raise ValueError("a path with restarts shows no growth; give runs without restarts")
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
