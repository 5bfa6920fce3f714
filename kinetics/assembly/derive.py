"""From a rule book to the reaction network it makes, by trying every join and every break.

Starting from free cubes, each structure found is joined with each other one in every placement of every
pair of open faces, and broken at every bond that holds two parts together, until nothing new appears. So the network is
complete, and a book whose structures grow without end is found out by the caps.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from kinetics.assembly.rules import RuleBook
from kinetics.assembly.structure import Structure, placements
from kinetics.network import Network

SIZE_NAMES = (
    *("monomer", "dimer", "trimer", "quadmer", "pentamer"),
    *("hexamer", "heptamer", "octamer", "nonamer", "decamer"),
)
Indices = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Derivation:
    """A network with the structures behind its species.

    network : joins first, then breaks; N of a join counts pairs of open faces, each of the four twists
        a quarter (a like pair of structures is one pair), N of a break the bonds that break so
    structures : species name -> its canonical structure
    """

    book: RuleBook
    network: Network
    structures: Mapping[str, Structure]

    def species_of(self, structure: Structure) -> int:
        """Index of the species that a structure, turned and placed in any way, belongs to."""
        canonical = structure.canonical(self.book.scheme)
        if canonical not in self._species:
            raise KeyError(f"{canonical} is none of the {len(self.structures)} species of book {self.book.name!r}")
        return self._species[canonical]

    def channel(self, before: Sequence[int], after: Sequence[int]) -> int:
        """Index of the channel that turns species `before` into species `after` (indices in any order)."""
        key = tuple(sorted(before)), tuple(sorted(after))
        if key not in self._channels:
            sides = (" + ".join(self.network.species[s] for s in side) for side in key)
            raise KeyError(f"no channel of book {self.book.name!r} turns {' into '.join(sides)}")
        return self._channels[key]

    @cached_property
    def _species(self) -> dict[Structure, int]:
        return {structure: index for index, structure in enumerate(self.structures.values())}

    @cached_property
    def _channels(self) -> dict[tuple[Indices, Indices], int]:
        before = self.network.reactants
        after = before + self.network.stoichiometry
        return {(_listed(b), _listed(a)): r for r, (b, a) in enumerate(zip(before, after, strict=True))}


def derive(book: RuleBook, max_cubes: int = 12, max_species: int = 2000) -> Derivation:
    """The network of everything that free cubes can become under a rule book.

    max_cubes, max_species : a book that leads beyond them is not closed under these caps; the ValueError names
        the join that does. Only bonds outside loops break.
    """
    if max_cubes < 1 or max_species < 1:
        raise ValueError(f"max_cubes = {max_cubes}, max_species = {max_species}; both must be at least 1")
    found = {book.monomer().canonical(book.scheme): 0}
    ways: defaultdict[tuple[Indices, Indices], float] = defaultdict(float)
    order = list(found)
    for new, structure in enumerate(order):  # grows as it is read
        for old in range(new + 1):
            for joined, weight in joins(book, order[old], structure):
                event = f"the join of {order[old]} and {structure}"
                if len(joined) > max_cubes:
                    raise ValueError(
                        f"book {book.name!r} is not closed under max_cubes = {max_cubes}: {event} has {len(joined)} "
                        "cubes; guard the rules against it, or raise the cap"
                    )
                after = _entered(joined, found, order, book, max_species, event)
                ways[(old, new), (after,)] += weight
        for fragments, weight in breaks(book, structure):
            event = f"a break of {structure}"
            ends = sorted(_entered(part, found, order, book, max_species, event) for part in fragments)
            ways[(new,), tuple(ends)] += weight
    return _named(book, order, ways)


def joins(book: RuleBook, a: Structure, b: Structure) -> Iterator[tuple[Structure, float]]:
    """Every way to join two structures: (joined structure, its share in N)."""
    views = [
        [(cube, face, book.view(structure, cube, face)) for cube, face in structure.open_faces()]
        for structure in (a, b)
    ]
    for (i, face_i, view_i), (j, face_j, view_j) in product(*views):
        if not book.allows(view_i, view_j):
            continue
        docked = [(a, i, b, j, placement) for placement in placements(a, i, face_i, b, j, face_j)]
        if book.semantics.update == "sequential":  # either cube may be the first to write
            docked += [(b, j, a, i, placement) for placement in placements(b, j, face_j, a, i, face_i)]
        for way in docked:
            joined = book.join(*way)
            if joined is not None:
                yield joined, 1 / len(docked)


def breaks(book: RuleBook, structure: Structure) -> Iterator[tuple[tuple[Structure, Structure], float]]:
    """Every way to break one bond of a structure: (the two fragments, their share in N)."""
    for i, j in structure.bonds:
        if structure.sides(i, j) is None:
            continue
        bonds = [(i, j), (j, i)] if book.semantics.update == "sequential" else [(i, j)]
        for bond in bonds:
            (_, first), (_, second) = book.break_bond(structure, *bond)
            yield (first, second), 1 / len(bonds)


def _entered(
    structure: Structure,
    found: dict[Structure, int],
    order: list[Structure],
    book: RuleBook,
    max_species: int,
    event: str,
) -> int:
    """Index of the structure in `found`; a new one is put at the end of `order`, to be explored in its turn."""
    canonical = structure.canonical(book.scheme)
    if canonical not in found:
        if len(order) == max_species:
            raise ValueError(
                f"book {book.name!r} makes more than max_species = {max_species} structures, the last by {event}; "
                "guard its rules, or raise the cap"
            )
        found[canonical] = len(order)
        order.append(canonical)
    return found[canonical]


def _named(book: RuleBook, order: Sequence[Structure], ways: Mapping[tuple[Indices, Indices], float]) -> Derivation:
    """The network, species sorted by size and channels by what they make or take, with names."""
    structures = sorted(order, key=lambda s: (len(s), s.positions, s.rotations, s.letters))
    place = {structure: index for index, structure in enumerate(structures)}
    new_index = [place[structure] for structure in order]
    sizes = [len(structure) for structure in structures]
    names = [_name(size, sizes[:index].count(size), sizes.count(size)) for index, size in enumerate(sizes)]
    short = [str(size) if sizes.count(size) == 1 else name for size, name in zip(sizes, names, strict=True)]

    events = {tuple(tuple(sorted(new_index[s] for s in side)) for side in key): n for key, n in ways.items()}
    channels = sorted(events, key=lambda key: (len(key[0]) == 1, *(key if len(key[0]) == 1 else key[::-1])))
    before, after = (
        np.array([np.bincount(key[side], minlength=len(structures)) for key in channels]).reshape(-1, len(structures))
        for side in (0, 1)
    )
    network = Network(
        species=tuple(names),
        channels=tuple("->".join("+".join(short[s] for s in side) for side in key) for key in channels),
        reactants=before.astype(np.int64),
        stoichiometry=(after - before).astype(np.int64),
        ways=np.array([events[key] for key in channels], dtype=float),
        conserved={"cubes": np.array(sizes, dtype=float)},
    )
    return Derivation(book, network, dict(zip(names, structures, strict=True)))


def _name(size: int, number: int, alike: int) -> str:
    """`trimer`, or `trimer.b` where several species have that size: .a to .z, .aa and on."""
    name = SIZE_NAMES[size - 1] if size <= len(SIZE_NAMES) else f"{size}-mer"
    if alike == 1:
        return name
    suffix = ""
    while number >= 0:
        number, letter = divmod(number, 26)
        suffix = chr(ord("a") + letter) + suffix
        number -= 1
    return f"{name}.{suffix}"


def _listed(counts: np.ndarray) -> Indices:
    """Species indices, each as often as it is counted, rising."""
    return tuple(np.repeat(np.arange(len(counts)), counts).tolist())
