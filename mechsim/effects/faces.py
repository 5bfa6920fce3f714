"""Search for pairs of faces that are within reach and that the rules let bond, for bonding and attraction."""

from __future__ import annotations

import math

import numpy as np

from kinetics.assembly import View
from mechsim import kernels
from mechsim.effects.view import ViewOfWorld

FINEST = 1 / 64  # what is missed by it at the scene's step: `tests/benchmarks/bench_looks.py`


class FacesWithinReach:
    """Pairs of faces of different bodies that look at each other within reach.

    distance, sideways : length, largest gap along the bisecting normal and largest offset of the centres across it
    angle : degrees, smallest between the outward normals
    in_passing : also those that were within reach since the last search, though they are no longer. A body younger
        than that search was elsewhere, or another one: it is looked at only as it is
    finest : share of the time since the last search; a passage that is shorter may be missed
    `kind` (C, 6) numbers what is distinguished in a face (-1: it is covered); `allowed` says which kinds may pair;
    `is_open` (C,), whether a cube has a face that may pair with any.
    """

    def __init__(
        self,
        world: ViewOfWorld,
        distance: float,
        angle: float,
        sideways: float,
        in_passing: bool = False,
        finest: float = FINEST,
    ):
        self.world, self.distance, self.sideways = world, distance, sideways
        self.in_passing, self.finest = in_passing, finest
        self.cosine = -math.cos(math.radians(angle))
        self.kind = np.zeros((world.bodies.n_cubes, 6), np.int64)
        self.allowed = np.ones((1, 1), bool)
        self.is_open = np.ones(world.bodies.n_cubes, bool)
        self.order = np.arange(world.bodies.n_cubes)
        self.found = np.zeros((64, 4), np.int64)
        self.looked = -math.inf  # time of the last search; the poses then:
        self.centre, self.axes = world.bodies.centre.copy(), world.bodies.axes.copy()

    def within_reach(self) -> np.ndarray:
        """Rows (cube, face, cube, face) of the pairs, in a fixed order; valid until the next call."""
        b = self.world.bodies
        while True:
            count = kernels.contact.facing_pairs(
                b.body, b.centre, b.axes, self.kind, self.allowed, b.edge, self.distance, self.cosine, self.sideways,
                b.born, self.looked, self.centre, self.axes, self.finest, self.order,
                self.is_open, self.found,
            )  # fmt: skip
            if count <= len(self.found):
                break
            self.found = np.zeros((2 * count, 4), np.int64)
        if self.in_passing:
            self.looked = self.world.time
            np.copyto(self.centre, b.centre)
            np.copyto(self.axes, b.axes)
        return self.found[:count]


class CompatibleFaces(FacesWithinReach):
    """Those of them that may bond by the rules."""

    def __init__(self, world: ViewOfWorld, distance: float, angle: float, sideways: float, in_passing: bool = False):
        super().__init__(world, distance, angle, sideways, in_passing)
        self.kind[:], self.is_open[:] = -1, False
        self.allowed = np.zeros((0, 0), bool)
        self.kinds: dict[View, int] = {}
        world.on_change(self.read_faces)

    def read_faces(self, slot: int) -> None:
        """What the rules distinguish in each face of a new body, as small numbers for the kernel."""
        bodies, book = self.world.bodies, self.world.book
        structure = bodies.held(slot)
        for index, cube in enumerate(bodies.members[slot]):
            for face in range(6):
                signature = book.view(structure, index, face)
                self.kind[cube, face] = -1 if signature is None else self.number(signature)
        cubes = list(bodies.members[slot])
        self.is_open[cubes] = self._may_pair(self.kind[cubes])

    def number(self, signature: View) -> int:
        """Number of a signature; a new one is compared with all known ones, once."""
        if signature not in self.kinds:
            self.kinds[signature] = len(self.kinds)
            book, known = self.world.book, list(self.kinds)
            self.allowed = np.array([[book.allows(a, b) for b in known] for a in known], bool)
            self.is_open = self._may_pair(self.kind)
        return self.kinds[signature]

    def _may_pair(self, kind: np.ndarray) -> np.ndarray:
        """Whether each cube has a face of a kind that may pair with any known one."""
        pairs = np.append(self.allowed.any(axis=1), False)  # the last: -1, a covered face
        may: np.ndarray = pairs[kind].any(axis=1)
        return may

    def still_may(self, i: int, face: int, j: int, other: int) -> bool:
        """May these faces bond as things stand? An earlier bond of this step may have covered one or joined both."""
        kinds, body = (self.kind[i, face], self.kind[j, other]), self.world.bodies.body
        return bool(body[i] != body[j] and min(kinds) >= 0 and self.allowed[kinds])
