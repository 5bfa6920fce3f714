"""Species by their role: the free cube, the seed, the target (their names come from the derivation)."""

from __future__ import annotations

from collections.abc import Sequence

from kinetics.assembly import Derivation, Structure


def species_of(derivation: Derivation, structure: Structure | None) -> str | None:
    """Name of a structure's species; None where there is no structure, or free cubes never become it."""
    try:
        return None if structure is None else derivation.network.species[derivation.species_of(structure)]
    except KeyError:
        return None


def single_cubes(derivation: Derivation, n_cubes: int) -> dict[str, int]:
    """Composition of so many single cubes; one of them is the seed, where the book has one."""
    free, seed = (species_of(derivation, cube) for cube in (derivation.book.monomer(), derivation.book.seed()))
    counts = {str(free): n_cubes} if seed is None else {str(free): n_cubes - 1, seed: 1}
    return {name: n for name, n in counts.items() if n}


def some_of(names: Sequence[str], most: int = 8) -> str:
    """Names for a message: all where they are few, else the first ones and how many more."""
    rest = len(names) - most
    return ", ".join(names[:most]) + (f" and {rest} more" if rest > 0 else "")
