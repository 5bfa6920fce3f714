"""The fate of each cube of a structure under joins, breaks and internal rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from kinetics.assembly.deriving.explore import Exploration
from kinetics.assembly.deriving.ways import breaks, joins_at, sites_of
from kinetics.assembly.structure import Structure


class Cube(NamedTuple):
    """A cube by the index of its structure and its number in the canonical form; of alike ones the first stands."""

    structure: int
    number: int


def sources_of_cubes(
    found: Exploration, progress: Callable[[int, int], None] = lambda *_: None
) -> dict[Cube, set[Cube]]:
    """Each cube of the structures found -> what it was one event before. Cost: that of the exploration, once more."""
    firsts = [_firsts(structure, found.book.scheme) for structure in found.structures]
    sources: dict[Cube, set[Cube]] = {
        Cube(index, number): set() for index, alike in enumerate(firsts) for number in set(alike)
    }
    for before, after in _moves(found, progress):
        was, is_now = (Cube(cube.structure, firsts[cube.structure][cube.number]) for cube in (before, after))
        sources[is_now].add(was)
    return sources


def _firsts(structure: Structure, scheme: str) -> list[int]:
    """Of each cube the first that symmetry puts into its place."""
    images = [
        [structure.places[symmetry.of(position)] for position in structure.positions]
        for symmetry in structure.symmetries(scheme)
    ]
    return [min(image[cube] for image in images) for cube in range(len(structure))]


def _moves(found: Exploration, progress: Callable[[int, int], None]) -> Iterator[tuple[Cube, Cube]]:
    """Every cube before and after every event, with repetitions."""
    book, settles, structures = found.book, not found.slow_waves, found.structures
    index = {structure: number for number, structure in enumerate(structures)}

    def ends(before: Sequence[Cube], made: Structure) -> Iterator[tuple[Cube, Cube]]:
        known = index.get(made.canonical(book.scheme))
        if known is not None:  # larger ones were left out
            for cube, number in zip(before, made.canonical_cubes(book.scheme), strict=True):
                yield cube, Cube(known, number)

    cubes = [[Cube(number, cube) for cube in range(len(structure))] for number, structure in enumerate(structures)]
    sites = [sites_of(book, structure) for structure in structures]
    sides = dict.fromkeys(event.before for event in found.events)
    for number, before in enumerate(sides):
        progress(number, len(sides))
        first = structures[before[0]]
        if len(before) == 2:
            i, j = before
            for made, _, _ in joins_at(book, first, sites[i], structures[j], sites[j], settles):
                yield from ends([*cubes[i], *cubes[j]], made)
            continue
        if book.semantics.bonds == "break":
            for fragments, _, _ in breaks(book, first, settles):
                for part in fragments:
                    yield from ends([cubes[before[0]][member] for member in part.members], part.structure)
        if found.slow_waves:
            for changed in book.steps(first):
                yield from ends(cubes[before[0]], changed)
