"""Faces of a cube, the 24 rotations of the cubic lattice, and which faces a cube can tell apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import permutations, product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
Position = tuple[int, int, int]


def _fixed(values: object) -> IntArray:
    """An integer table that nobody can write to."""
    array = np.array(values, dtype=np.int64)
    array.setflags(write=False)
    return array


# Faces 0..5 look along +x, -x, +y, -y, +z, -z of the cube's own frame; face ^ 1 is the opposite face.
# Plain tuples beside the array: looking up single numbers in NumPy arrays costs ten times as much.
NORMALS: tuple[Position, ...] = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
FACE_NORMALS = _fixed(NORMALS)


def _proper_rotations() -> IntArray:
    """The signed permutation matrices of determinant +1 (24, 3, 3), identity first."""
    found = []
    for axes in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            matrix = np.zeros((3, 3), dtype=np.int64)
            matrix[range(3), axes] = signs
            if round(np.linalg.det(matrix)) == 1:
                found.append(matrix)
    return _fixed(found)


ROTATIONS = _proper_rotations()
_INDEX = {matrix.tobytes(): index for index, matrix in enumerate(ROTATIONS)}

# compose[a, b] is the rotation "first b, then a"; inverse[a] undoes a.
compose = _fixed([[_INDEX[(a @ b).tobytes()] for b in ROTATIONS] for a in ROTATIONS])
inverse = _fixed([_INDEX[np.ascontiguousarray(a.T).tobytes()] for a in ROTATIONS])

# turned[r, f]: the direction (numbered as the faces are) in which face f looks after rotation r.
turned = _fixed(np.argmax((ROTATIONS @ FACE_NORMALS.T).transpose(0, 2, 1) @ FACE_NORMALS.T, axis=2))


@dataclass(frozen=True)
class FaceScheme:
    """A face scheme: which faces of a cube can be distinguished.

    types : name of the type of each of the six faces, in the order of FACE_NORMALS
    rolls : the twists that cubes can distinguish as they meet, if they sense the twist (see `roll`)
    """

    name: str
    types: tuple[str, str, str, str, str, str]
    rolls: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The distinct face types, sorted."""
        return tuple(sorted(set(self.types)))

    @property
    def symmetry(self) -> tuple[int, ...]:
        """The rotations of a cube that this scheme cannot see: 24 for `one`, 8 for `two`, 1 for `six`."""
        return tuple(
            rotation
            for rotation in range(len(ROTATIONS))
            if all(self.types[turned[rotation, face]] == self.types[face] for face in range(6))
        )

    @property
    def reduced(self) -> IntArray:
        """For each of the 24 rotations, the smallest rotation of a cube that looks the same (24,).

        A cube's rotation leads from its own frame to the structure's, so an unseen turn acts first.
        """
        return np.asarray(compose[:, self.symmetry].min(axis=1))


# The paper's f1 is top and bottom and f2 the sides (section IV); `six` are its f1..f6 told apart.
SCHEMES: Mapping[str, FaceScheme] = MappingProxyType(
    {
        scheme.name: scheme
        for scheme in (
            FaceScheme("one", ("f1", "f1", "f1", "f1", "f1", "f1")),
            FaceScheme("two", ("f2", "f2", "f2", "f2", "f1", "f1"), ("parallel", "crossed")),
            FaceScheme("six", ("f1", "f2", "f3", "f4", "f5", "f6"), ("0", "90", "180", "270")),
        )
    }
)


def scheme_of(name: str) -> FaceScheme:
    """The face scheme of that name."""
    if name not in SCHEMES:
        raise ValueError(f"unknown face scheme {name!r}; known are {', '.join(SCHEMES)}")
    return SCHEMES[name]


@cache
def roll(scheme: str, rotation: int, face: int, partner_rotation: int) -> str:
    """The twist between a cube and the one that its own face meets, the same seen from either of them.

    `two`: whether their f1 axes are parallel or crossed, which is all that faces alike in pairs leave to see.
    `six`: the angle in degrees, about the face's outward normal, from the cube's reference to the partner's; the
    reference of a face on x is the cube's own +y, on y its +z, on z its +x.
    """
    if scheme == "two":
        own, other = (turned[r, 4] // 2 for r in (rotation, partner_rotation))
        return "parallel" if own == other else "crossed"
    if scheme != "six":
        raise ValueError(f"scheme {scheme!r} shows no twist between cubes; use the faces of `two` or `six`")
    outward = int(turned[rotation, face])
    partner_face = turned[partner_rotation].tolist().index(outward ^ 1)
    own, other = turned[rotation, _reference(face)], turned[partner_rotation, _reference(partner_face)]
    quarter = np.cross(FACE_NORMALS[outward], FACE_NORMALS[own])
    x, y = (int(axis @ FACE_NORMALS[other]) for axis in (FACE_NORMALS[own], quarter))
    return {(1, 0): "0", (0, 1): "90", (-1, 0): "180", (0, -1): "270"}[x, y]


def _reference(face: int) -> int:
    """The face whose normal marks the twist of another one."""
    return (face // 2 * 2 + 2) % 6
