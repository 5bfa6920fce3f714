"""Structures: rigid groups of cubes on the cubic lattice, compared up to rotation and translation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from kinetics.assembly.faces import NORMALS, ROTATIONS, IntArray, Position, compose, scheme_of, turned
from kinetics.support.shown import on_axes

# Plain tuples: looking up single numbers in NumPy arrays costs ten times as much.
_MATRICES = ROTATIONS.reshape(-1, 9).tolist()
_COMPOSE = compose.tolist()
_TURNED: list[list[int]] = turned.tolist()
_FACE_TOWARDS = [[row.index(direction) for direction in range(6)] for row in _TURNED]
# The four rotations that turn direction d_b (of b's lattice) into d_a: one a twist about it.
_TURNING = [
    [[r for r in range(24) if _TURNED[r][towards_b] == towards_a] for towards_b in range(6)] for towards_a in range(6)
]


class Placement(NamedTuple):
    """A placement of one lattice in another: position -> rotation @ position + translation."""

    rotation: int
    translation: Position

    def of(self, position: Position) -> Position:
        """The position to which a position is moved."""
        a, b, c, d, e, f, g, h, k = _MATRICES[self.rotation]
        (x, y, z), (u, v, w) = position, self.translation
        return a * x + b * y + c * z + u, d * x + e * y + f * z + v, g * x + h * y + k * z + w


@dataclass(frozen=True)
class Structure:
    """A rigid group of bonded cubes with letters; all cubes that touch are bonded.

    positions : lattice places, all different, connected through faces
    rotations : index into ROTATIONS, from the cube's own frame to the structure's
    letters : the state of each cube
    """

    positions: tuple[Position, ...]
    rotations: tuple[int, ...]
    letters: tuple[str, ...]

    def __post_init__(self) -> None:
        n = len(self.positions)
        if n == 0 or len(self.rotations) != n or len(self.letters) != n:
            raise ValueError(
                f"a structure needs at least one cube and as many rotations and letters as positions; got {n} "
                f"positions, {len(self.rotations)} rotations, {len(self.letters)} letters"
            )
        if len(self.places) != n:
            twice = next(p for p in self.positions if self.positions.count(p) > 1)
            raise ValueError(f"two cubes overlap at {twice}; every cube needs its own lattice place")
        if not all(0 <= r < 24 for r in self.rotations):
            raise ValueError(f"rotations are {self.rotations}; each must be an index from 0 to 23")
        if len(self._reach(0)) != n:
            raise ValueError(f"the cubes at {self.positions} do not all hang together through faces")

    def __len__(self) -> int:
        return len(self.positions)

    def __str__(self) -> str:
        """`b(0,0,0) c(0,0,1)`: letters and places, for messages."""
        cubes = zip(self.letters, self.positions, strict=True)
        return " ".join(f"{letter}({x},{y},{z})" for letter, (x, y, z) in cubes)

    @cached_property
    def places(self) -> dict[Position, int]:
        """Lattice place -> cube."""
        return {position: cube for cube, position in enumerate(self.positions)}

    @cached_property
    def _adjacent(self) -> tuple[tuple[int, ...], ...]:
        return tuple(self.touching(position) for position in self.positions)

    def touching(self, position: Position) -> tuple[int, ...]:
        """The cubes on the six sides of a lattice place."""
        at, (x, y, z) = self.places.get, position
        six = [at((x + u, y + v, z + w)) for u, v, w in NORMALS]
        return tuple([cube for cube in six if cube is not None])

    @cached_property
    def bonds(self) -> tuple[tuple[int, int], ...]:
        """Pairs (i, j), i < j, of touching cubes, sorted."""
        return tuple((i, j) for i, six in enumerate(self._adjacent) for j in sorted(six) if i < j)

    def neighbours(self, cube: int) -> tuple[int, ...]:
        """The cubes bonded to `cube`."""
        known = self.__dict__.get("_adjacent")  # not worth finding out for all cubes to answer for one
        return self.touching(self.positions[cube]) if known is None else known[cube]

    def cube_at(self, position: Position) -> int | None:
        """The cube at a lattice place, or None."""
        return self.places.get(position)

    def faced(self, cube: int, face: int) -> Position:
        """The lattice place in front of a cube's own face."""
        return self._beside(cube, _TURNED[self.rotations[cube]][face])

    def face_towards(self, cube: int, position: Position) -> int:
        """The cube's own face towards a neighbouring lattice place."""
        x, y, z = self.positions[cube]
        step = (position[0] - x, position[1] - y, position[2] - z)
        if step not in NORMALS:
            raise ValueError(f"{position} is not beside cube {cube} at {(x, y, z)}")
        return _FACE_TOWARDS[self.rotations[cube]][NORMALS.index(step)]

    def open_faces(self) -> list[tuple[int, int]]:
        """All (cube, own face) with nothing in front, in order."""
        return [
            (cube, face) for cube in range(len(self)) for face in range(6) if self.faced(cube, face) not in self.places
        ]

    def sides(self, i: int, j: int) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
        """The cubes on i's and on j's side of their bond; None if a loop holds the sides together."""
        if j not in self._adjacent[i]:
            raise ValueError(f"cubes {i} and {j} do not touch; bonds are {self.bonds}")
        near = self._reach(i, without=j)
        if j in near:
            return None
        return tuple(sorted(near)), tuple(cube for cube in range(len(self)) if cube not in near)

    def part(self, members: Sequence[int]) -> Structure:
        """The structure of some of the cubes, in place."""
        return Structure(
            tuple(self.positions[cube] for cube in members),
            tuple(self.rotations[cube] for cube in members),
            tuple(self.letters[cube] for cube in members),
        )

    def moved(self, placement: Placement) -> Structure:
        """A copy placed in another lattice."""
        turn = _COMPOSE[placement.rotation]
        places = tuple(placement.of(position) for position in self.positions)
        return Structure.unchecked(places, tuple(turn[rotation] for rotation in self.rotations), self.letters)

    def turned(self, rotation: int) -> Structure:
        """A copy turned about the lattice's origin; rotation is an index into ROTATIONS."""
        return self.moved(Placement(rotation, (0, 0, 0)))

    def reordered(self, cubes: Sequence[int]) -> Structure:
        """A copy with its cubes numbered in another order."""
        columns = zip(*((self.positions[c], self.rotations[c], self.letters[c]) for c in cubes), strict=True)
        positions, rotations, letters = columns
        return Structure.unchecked(positions, rotations, letters)

    def with_letters(self, letters: Sequence[str]) -> Structure:
        """A copy with other letters."""
        changed = Structure.unchecked(self.positions, self.rotations, tuple(letters))
        for cached in ("places", "_adjacent"):  # the same as before
            if cached in self.__dict__:
                changed.__dict__[cached] = self.__dict__[cached]
        return changed

    def joined(self, other: Structure) -> Structure:
        """This structure's cubes, then those of the other, which must lie beside it without overlap."""
        return Structure.unchecked(
            self.positions + other.positions, self.rotations + other.rotations, self.letters + other.letters
        )

    @classmethod
    def unchecked(
        cls, positions: tuple[Position, ...], rotations: tuple[int, ...], letters: tuple[str, ...]
    ) -> Structure:
        """Make a structure that is known to be valid without the checks, which would double the cost of a join."""
        made = object.__new__(cls)
        made.__dict__.update(positions=positions, rotations=rotations, letters=letters)
        return made

    def canonical(self, scheme: str) -> Structure:
        """The one representative of all structures that look the same under a face scheme.

        The smallest, over the 24 rotations, of the sorted list of (position, reduced rotation, letter),
        with the bounding box at the origin. Mirror images are different structures.
        """
        return _canonical(self, scheme)[0]

    def canonical_cubes(self, scheme: str) -> tuple[int, ...]:
        """Of each cube, its number in the canonical form; where symmetry leaves a choice, one of them."""
        codes = _codes(self, scheme)[0]
        smallest = min(codes, key=lambda turned: sorted(turned.tolist()))
        return tuple(np.argsort(np.argsort(smallest)).tolist())

    def symmetry_number(self, scheme: str) -> int:
        """How many of the 24 rotations map the structure onto itself, as far as the scheme can see."""
        return _canonical(self, scheme)[1]

    def symmetries(self, scheme: str) -> tuple[Placement, ...]:
        """The placements that put the structure onto itself, as far as the scheme can see; the identity first."""
        codes = np.sort(_codes(self, scheme)[0], axis=1).tolist()
        found = []
        for rotation in (r for r in range(24) if codes[r] == codes[0]):
            turned_places = [Placement(rotation, (0, 0, 0)).of(p) for p in self.positions]
            x, y, z = (
                min(c) - min(t)
                for c, t in zip(zip(*self.positions, strict=True), zip(*turned_places, strict=True), strict=True)
            )
            found.append(Placement(rotation, (x, y, z)))
        return tuple(found)

    def drawn(self) -> str:
        """The letters in layers from the lowest z up, with y upwards and x to the right; a dot is an empty place."""
        (x0, x1), (y0, y1), (z0, z1) = ((min(c), max(c)) for c in zip(*self.positions, strict=True))
        width = max(map(len, self.letters))

        def cell(x: int, y: int, z: int) -> str:
            cube = self.cube_at((x, y, z))
            return ("." if cube is None else self.letters[cube]).rjust(width)

        rows = [
            "   ".join(" ".join(cell(x, y, z) for x in range(x0, x1 + 1)) for z in range(z0, z1 + 1))
            for y in range(y1, y0 - 1, -1)
        ]
        return "\n".join(rows)

    @on_axes
    def plot(self, ax: Any, scheme: str = "two", **options: Any) -> Any:
        """Draw onto axes, faces coloured by type; options as in `pictures.structure_drawing`. Returns `ax`."""
        from kinetics.assembly.drawing.pictures import structure_drawing

        return structure_drawing(self, scheme, **options).onto(ax)

    def _beside(self, cube: int, direction: int) -> Position:
        (x, y, z), (u, v, w) = self.positions[cube], NORMALS[direction]
        return x + u, y + v, z + w

    def _reach(self, start: int, without: int = -1) -> set[int]:
        """The cubes that hang together with `start`, its own bond to `without` not counted."""
        reached = {start}
        fresh = [cube for cube in self._adjacent[start] if cube != without]
        while fresh:
            cube = fresh.pop()
            if cube not in reached:
                reached.add(cube)
                fresh.extend(self._adjacent[cube])
        return reached


def placements(
    a: Structure, i: int, face_i: int, b: Structure, j: int, face_j: int
) -> tuple[Placement, Placement, Placement, Placement]:
    """The four placements (one per twist) of b in a's lattice that put face_j of b's cube j on face_i of a's cube i."""
    towards_b = _TURNED[a.rotations[i]][face_i] ^ 1  # j's face looks back at i
    target = a.faced(i, face_i)
    first, second, third, fourth = (
        _put(b.positions[j], rotation, target) for rotation in _TURNING[towards_b][_TURNED[b.rotations[j]][face_j]]
    )
    return first, second, third, fourth


def _put(position: Position, rotation: int, target: Position) -> Placement:
    """The placement with that rotation that takes `position` to `target`."""
    x, y, z = Placement(rotation, (0, 0, 0)).of(position)
    return Placement(rotation, (target[0] - x, target[1] - y, target[2] - z))


@lru_cache(maxsize=8)
def _reduced_compose(scheme: str) -> IntArray:
    """[r, s]: what is seen of a cube's rotation s after the whole structure is turned by r."""
    return scheme_of(scheme).reduced[compose]


def _codes(structure: Structure, scheme: str) -> tuple[np.ndarray, int, list[str]]:
    """The 24 turned copies (24, n), every cube coded as one integer; with the base of the code of places and the
    alphabet. Codes are ordered as (position, seen rotation, letter).
    """
    places = ROTATIONS @ np.array(structure.positions).T  # (24, 3, n)
    places -= places.min(axis=2, keepdims=True)
    span = int(places.max()) + 1
    alphabet = sorted(set(structure.letters))
    letters = np.array([alphabet.index(letter) for letter in structure.letters])
    seen = _reduced_compose(scheme)[:, structure.rotations]  # (24, n)
    codes = (places[:, 0] * span + places[:, 1]) * span + places[:, 2]
    codes = (codes * 24 + seen) * len(alphabet) + letters
    return codes, span, alphabet


@lru_cache(maxsize=1 << 14)
def _canonical(structure: Structure, scheme: str) -> tuple[Structure, int]:
    """Canonical form and symmetry number."""
    codes, span, alphabet = _codes(structure, scheme)
    copies = np.sort(codes, axis=1).tolist()
    smallest = min(copies)
    cubes = []
    for code in smallest:
        rest, letter = divmod(code, len(alphabet))
        rest, rotation = divmod(rest, 24)
        rest, z = divmod(rest, span)
        cubes.append(((*divmod(rest, span), z), rotation, alphabet[letter]))
    positions, rotations, names = zip(*cubes, strict=True)
    return Structure.unchecked(positions, rotations, names), copies.count(smallest)
