"""The shapes of part of a dodecahedron, how two of them dock, and which bonds hold a shape together.

A complex of n faces is a connected set of n of the twelve faces of a dodecahedron; sets that a rotation carries into
each other are one shape. There are 73 shapes. A free edge of one complex docks at a free edge of another in one way
only, since the faces of a shell are rigid; it is refused if two faces would lie in the same place. All of this is
geometry: nothing here is fitted to a run.
"""

from __future__ import annotations

from collections import Counter
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinetics import simulate
from kinetics.network import Model, Network

FACES = range(12)
SIZES = range(1, 13)
PAIRS = [(i, j) for i in SIZES for j in range(i, 13 - i)]  # sizes that fit on one dodecahedron, the smaller first
VOLUME = 500.0**3  # nm3
SITE_RATE = (5 * 2.0 + 20 * 4.0) / 25  # nm3/us for a pair of edges: 5 of 25 are alike, at 2, the others at 4
INPUT_K, INPUT_B = SITE_RATE * 1e6 / VOLUME, 2.0  # the simulator's inputs, 1/s: per pair of edges, and per bond
RUNS, SEED = 200, 11  # of the shapes' network, for the means


class Weights(NamedTuple):
    """Means over the shapes of each size, tables (13, 13) indexed by the two sizes.

    dockings : ways in which a pair of complexes can dock, the same in both orders
    bridges : bonds of a complex that alone hold two parts of these sizes together; the smaller size first
    """

    dockings: np.ndarray
    bridges: np.ndarray


class Shapes:
    """All shapes, by number, the single face first.

    masks : a set of faces for each shape, as bits
    sizes : (N,) faces
    """

    def __init__(self) -> None:
        golden = (1 + 5**0.5) / 2
        cyclic = [(0.0, s, t) for s in (1.0, -1.0) for t in (golden, -golden)]
        normals = np.array([np.roll(v, turn) for v in cyclic for turn in range(3)])  # an icosahedron's corners
        self.adjacent = np.isclose(normals @ normals.T, golden)
        self._edges = [(a, int(b)) for a in FACES for b in np.flatnonzero(self.adjacent[a])]  # directed
        self._turn_of = {pair: self._turns(normals, *pair) for pair in self._edges}
        bits = 1 << np.arange(12)
        images = np.array([bits[turn] for turn in self._turn_of[self._edges[0]].values()])  # of each face, by rotation
        self.number: dict[int, int] = {}  # of the shape of each connected set
        self.masks: list[int] = []
        for mask in sorted(range(1, 2**12), key=lambda m: (m.bit_count(), m)):
            if mask not in self.number and len(self.parts(self.faces(mask))) == 1:
                orbit = (images @ (mask >> np.arange(12) & 1)).tolist()
                self.number |= dict.fromkeys(orbit, len(self.masks))
                self.masks.append(mask)
        self.sizes = np.array([mask.bit_count() for mask in self.masks])

    def _turns(self, normals: np.ndarray, face: int, towards: int) -> dict[tuple[int, int], np.ndarray]:
        """Where each rotation carries the faces (12,), by where it carries `face` and its neighbour `towards`."""

        def frame(a: int, b: int) -> np.ndarray:
            return np.array([normals[a], normals[b], np.cross(normals[a], normals[b])]).T

        back = np.linalg.inv(frame(face, towards))
        return {pair: (normals @ (frame(*pair) @ back).T @ normals.T).argmax(axis=1) for pair in self._edges}

    @staticmethod
    def faces(mask: int) -> list[int]:
        return [face for face in FACES if mask >> face & 1]

    def parts(self, faces: list[int], cut: tuple[int, int] | None = None) -> list[int]:
        """The connected parts of a set of faces, as masks, without the bond between the two faces of `cut`."""
        left, found = set(faces), []
        while left:
            stack = [left.pop()]
            mask = 1 << stack[0]
            while stack:
                face = stack.pop()
                near = {other for other in left if self.adjacent[face, other] and {face, other} != set(cut or ())}
                left -= near
                stack += near
                mask |= sum(1 << other for other in near)
            found.append(mask)
        return found

    @cached_property
    def dockings(self) -> dict[tuple[int, int], Counter[int]]:
        """(shape, shape), the smaller number first -> shape made -> number of pairs of edges that make it."""
        free = [[(a, b) for a, b in self._edges if mask >> a & 1 and not mask >> b & 1] for mask in self.masks]
        found = {}
        for first, one in enumerate(self.masks):
            for second in range(first, len(self.masks)):
                made: Counter[int] = Counter()
                others = self.faces(self.masks[second])
                for a, b in free[first]:
                    for edge in free[second]:
                        turn = self._turn_of[edge][b, a]  # the other's face comes to lie at b and looks at a
                        other = sum(1 << int(turn[face]) for face in others)
                        if not other & one:
                            made[self.number[other | one]] += 1
                if made:
                    found[first, second] = made
        return found

    @cached_property
    def bridges(self) -> dict[int, Counter[tuple[int, int]]]:
        """Shape -> the two shapes that are left -> number of bonds whose loss leaves them."""
        found = {}
        for shape, mask in enumerate(self.masks):
            left: Counter[tuple[int, int]] = Counter()
            for bond in combinations(faces := self.faces(mask), 2):
                if self.adjacent[bond] and len(parts := self.parts(faces, bond)) == 2:
                    first, second = sorted(self.number[part] for part in parts)
                    left[first, second] += 1
            if left:
                found[shape] = left
        return found

    def network(self, k: float, b: float) -> Model:
        """200 single faces; each pair of edges joins at rate k, and each bond that alone holds parts breaks at b.

        k, b : 1/s. A bond within a ring is taken to close again at once.
        """
        lines = ["species: " + ", ".join(f"x{shape}" for shape in range(len(self.masks)))]
        for (one, other), made in self.dockings.items():
            lines += [f"x{one} + x{other} -> x{shape}, {ways} * k" for shape, ways in made.items()]
        for shape, left in self.bridges.items():
            lines += [f"x{shape} -> x{one} + x{other}, {bonds} * b" for (one, other), bonds in left.items()]
        return Model.of(Network.from_text("\n".join([*lines, "x0 = 200"]), k=k, b=b))


def weights_of(shapes: Shapes) -> Weights:
    """Means over the shapes that form at the simulator's inputs: 200 runs of 1 s, each pair or complex each ms."""
    runs = simulate(shapes.network(INPUT_K, INPUT_B), "ssa", times=1e-3 * np.arange(1001), runs=RUNS, seed=SEED)
    counts = runs.counts.astype(float)
    alone = counts.sum(axis=(0, 1))
    pairs = np.tensordot(counts, counts, ((0, 1), (0, 1))) - np.diag(alone)
    docked, held = np.zeros((2, 13, 13))
    ways = np.zeros(pairs.shape)
    for (one, other), made in shapes.dockings.items():
        ways[one, other] = ways[other, one] = made.total()
    for i, j in PAIRS:
        there = np.ix_(shapes.sizes == i, shapes.sizes == j)
        docked[i, j] = docked[j, i] = (pairs[there] * ways[there]).sum() / pairs[there].sum()
    for shape, left in shapes.bridges.items():
        for (one, other), bonds in left.items():
            i, j = sorted((shapes.sizes[one], shapes.sizes[other]))
            held[i, j] += bonds * alone[shape] / alone[shapes.sizes == i + j].sum()
    return Weights(docked, held)


def as_table(weights: Weights) -> pd.DataFrame:
    """One row for each pair of sizes."""
    rows = [(i, j, weights.dockings[i, j], weights.bridges[i, j]) for i, j in PAIRS]
    return pd.DataFrame(rows, columns=["i", "j", "dockings", "bridges"]).round(5)
