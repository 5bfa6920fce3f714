"""The parts of a target: its connected pieces, known again wherever they lie and however they are turned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kinetics.assembly.compiler.orientation import MOST
from kinetics.assembly.faces import ROTATIONS, IntArray, compose, scheme_of
from kinetics.assembly.structure import Structure

# Numbers drawn for a cube at a place, seen so; their sums are alike for alike parts, and rarely for others.
_DRAWN = np.random.default_rng(0).integers(1 << 58, size=(MOST, MOST, MOST, 24))


@dataclass(frozen=True, eq=False)
class Part:
    """A connected piece of the target, up to rotation.

    unknowns : the unknown that stands for each cube's letter: one for each set of cubes that symmetry makes alike
    symmetries : where each cube goes under each rotation that puts the part onto itself
    """

    structure: Structure
    unknowns: tuple[int, ...]
    symmetries: tuple[tuple[int, ...], ...]
    name: str

    def __len__(self) -> int:
        return len(self.structure)

    def around(self, cube: int, *without: int) -> tuple[int, ...]:
        """The unknowns of a cube's neighbours, sorted."""
        return tuple(sorted(self.unknowns[n] for n in self.structure.neighbours(cube) if n not in without))


class Parts:
    """The connected pieces of a structure, each once.

    parts : smallest first, a free cube at the beginning
    tick : called again and again; it may raise to end the work
    """

    def __init__(self, whole: Structure, scheme: str, tick: Callable[[], None] = lambda: None):
        self.scheme, self.seen = scheme, scheme_of(scheme).reduced
        structures = sorted(pieces_of(whole, scheme, tick), key=lambda s: (len(s), s.positions, s.rotations))
        self.numbers = {structure: number for number, structure in enumerate(structures)}
        self.parts: list[Part] = []
        for structure, name in zip(structures, _names([len(structure) for structure in structures]), strict=True):
            tick()
            symmetries = tuple(
                tuple(structure.places[symmetry.of(place)] for place in structure.positions)
                for symmetry in structure.symmetries(scheme)
            )
            unknown = 1 + max(self.parts[-1].unknowns) if self.parts else 0
            first = [min(symmetry[cube] for symmetry in symmetries) for cube in range(len(structure))]
            orbits = {cube: unknown + n for n, cube in enumerate(sorted(set(first)))}
            self.parts.append(Part(structure, tuple(orbits[cube] for cube in first), symmetries, name))

    def turns(self, part: Part) -> IntArray:
        """The rotations under which a part looks different, the first of those alike."""
        alike = [symmetry.rotation for symmetry in part.structure.symmetries(self.scheme)]
        return np.unique(compose[:, alike].min(axis=1))

    def known(self, structure: Structure) -> tuple[int, tuple[int, ...]] | None:
        """Which part some cubes are, and which of its cubes each of them is; None: no part."""
        number = self.numbers.get(structure.canonical(self.scheme))
        return None if number is None else (number, structure.canonical_cubes(self.scheme))

    def may_be_known(self, positions: IntArray, rotations: IntArray) -> NDArray[np.bool_]:
        """Which of many sets of cubes (sets, n, 3) and (sets, n) may be parts; those that may not, are none."""
        fits = np.asarray((np.ptp(positions, axis=1) < MOST).all(axis=1))
        fits[fits] = np.isin(self._sum(positions[fits], rotations[fits]), self._sums)
        return fits

    @cached_property
    def _sums(self) -> IntArray:
        found = []
        for structure in self.numbers:
            places = (ROTATIONS @ np.array(structure.positions).T).transpose(0, 2, 1)
            found.append(self._sum(places, compose[:, structure.rotations]))
        return np.concatenate(found)

    def _sum(self, places: IntArray, rotations: IntArray) -> IntArray:
        x, y, z = (places - places.min(axis=1, keepdims=True)).transpose(2, 0, 1)
        return np.asarray(_DRAWN[x, y, z, self.seen[rotations]].sum(axis=1))


def pieces_of(whole: Structure, scheme: str, tick: Callable[[], None] = lambda: None) -> set[Structure]:
    """The connected pieces of a structure up to rotation, itself among them."""
    subsets = {frozenset({cube}) for cube in range(len(whole))}
    fresh = subsets
    while fresh:
        tick()
        fresh = {s | {n} for s in fresh for cube in s for n in whole.neighbours(cube) if n not in s} - subsets
        subsets |= fresh
    return {whole.part(sorted(subset)).canonical(scheme) for subset in subsets}


def _names(sizes: Sequence[int]) -> list[str]:
    """`3`, or `3.b` if several parts have that size."""
    names = []
    for n, size in enumerate(sizes):
        number, suffix = sizes[:n].count(size), ""
        while number >= 0:
            number, letter = divmod(number, 26)
            suffix = chr(ord("a") + letter) + suffix
            number -= 1
        names.append(f"{size}.{suffix}" if sizes.count(size) > 1 else str(size))
    return names
