"""Growth along a spanning tree: six distinct faces and the twist suffice for any target.

A cube's letter tells which subtree hangs on it, up to rotation, so each of its faces takes one kind of cube at one
face and one twist, whatever else is there. Few letters means a tree with few different subtrees. A path from the seed
to a leaf shows no subtree twice, so it takes at least as many letters as the seed is bonds from the farthest cube,
and one more; and that of a free cube.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np

from kinetics.assembly.compiler.budget import OutOfStepsError
from kinetics.assembly.compiler.growth import beside
from kinetics.assembly.faces import Position, compose, inverse, roll, turned
from kinetics.assembly.rules.conditions import Combination

FREE = "a"
_COMPOSE, _INVERSE, _TURNED = compose.tolist(), inverse.tolist(), turned.tolist()
Branches = tuple[tuple[int, int, int], ...]  # direction, kind and turn of each child, sorted
Hung = tuple[int, int]  # the kind of a subtree, and how it is turned
Parent = tuple[Position, int]  # the cube on which one hangs, and in which direction from there


class Kinds:
    """Subtrees up to rotation, each known by a number; the turn of one is that of its root's own frame."""

    def __init__(self) -> None:
        self.branches: list[Branches] = []
        self.seen: list[list[int]] = []  # for each turn of a subtree, the smallest that looks the same
        self._known: dict[Branches, int] = {}
        self._found: dict[Branches, Hung] = {}

    def of(self, branches: Branches) -> Hung:
        """Kind and turn of the subtree with these branches."""
        if branches not in self._found:
            images = [self._turned(branches, turn) for turn in range(24)]
            smallest = min(images)
            kind = self._known.setdefault(smallest, len(self.branches))
            alike = [_INVERSE[turn] for turn in range(24) if images[turn] == smallest]
            if kind == len(self.branches):
                self.branches.append(smallest)
                same = [turn for turn in range(24) if self._turned(smallest, turn) == smallest]
                self.seen.append([min(_COMPOSE[turn][s] for s in same) for turn in range(24)])
            self._found[branches] = kind, min(alike)
        return self._found[branches]

    def _turned(self, branches: Branches, turn: int) -> Branches:
        """The branches after a rotation of the whole."""
        directions, turns = _TURNED[turn], _COMPOSE[turn]
        return tuple(sorted([(directions[d], kind, self.seen[kind][turns[own]]) for d, kind, own in branches]))


@dataclass(frozen=True, eq=False)
class Tree:
    """A spanning tree of a target.

    hung : place -> the subtree that hangs on it; the seed's last
    kinds : what the numbers of the subtrees mean
    """

    hung: dict[Position, Hung]
    kinds: Kinds

    @classmethod
    def of(cls, parents: dict[Position, Parent | None], kinds: Kinds) -> Tree:
        """The tree in which these places, the farthest from the seed first, hang on others."""
        branches: dict[Position, list[tuple[int, int, int]]] = {place: [] for place in parents}
        hung = {}
        for place, parent in parents.items():
            hung[place] = kinds.of(tuple(sorted(branches[place])))
            if parent is not None:
                branches[parent[0]].append((parent[1], *hung[place]))
        return cls(hung, kinds)

    @cached_property
    def letters(self) -> list[int]:
        """The kinds of subtrees that occur, the last one found first."""
        return sorted({kind for kind, _ in self.hung.values()}, reverse=True)

    @cached_property
    def cost(self) -> float:
        """Letters; and of as many, better those with a rare kind, which may go next."""
        counts = Counter(kind for kind, _ in self.hung.values())
        return len(counts) + math.fsum(1 / n for n in counts.values())

    @cached_property
    def rotations(self) -> dict[Position, int]:
        """How each cube is turned: as the rules make it come, from the seed on."""
        seed = next(reversed(self.hung))
        found = {seed: self.hung[seed][1]}
        waiting = [seed]
        for place in waiting:
            turn = found[place]
            for face, _, own in self.kinds.branches[self.hung[place][0]]:
                child = beside(place)[_TURNED[turn][face]]
                found[child] = _COMPOSE[turn][own]
                waiting.append(child)
        return found

    def rules(self, names: dict[int, str]) -> list[Combination]:
        """Two rules for each branch of each kind of subtree: the one that hosts and the one that comes."""
        found = []
        for kind in self.letters:
            for face, child, turn in self.kinds.branches[kind]:
                own = _TURNED[turn].index(face ^ 1)
                name, twist = names[kind], (roll("six", turn, own, 0),)
                for rule, letter, partner, becomes, (f, g) in (
                    (f"{FREE} docks at f{face + 1} of {name}", FREE, name, names[child], (own, face)),
                    (f"{name} takes {FREE} on f{face + 1}", name, FREE, name, (face, own)),
                ):
                    faces = {"face": (f"f{f + 1}",), "partner_face": (f"f{g + 1}",), "roll": twist}
                    found.append(Combination(rule=rule, letter=(letter,), partner=(partner,), becomes=becomes, **faces))
        return found


def spanning_tree(
    places: Sequence[Position],
    seed: Position,
    rng: np.random.Generator,
    moves: int,
    report: Callable[[Tree], None] = lambda _: None,
    tick: Callable[[], None] = lambda: None,
) -> Tree:
    """A tree of shortest paths with few different subtrees, by annealing from regular ones, two an order of axes.

    moves : in which one cube is hung on another neighbour; how many are tried from each start
    report : called with every better tree; tick : called at every move
    An error of `tick` that time or steps are used up ends the search; the best tree so far is returned.
    """
    best: Tree | None = None
    distance = distances(places, seed)
    bound = max(distance.values()) + 1
    inwards = {
        place: [(p, d ^ 1) for d, p in enumerate(beside(place)) if distance.get(p, bound) < distance[place]]
        for place in places
    }
    free = [place for place, choices in inwards.items() if len(choices) > 1]
    try:
        for order in 2 * list(permutations(range(3))):
            kinds = Kinds()
            axes = sorted(range(3), key=order.__getitem__)
            choices = {p: [way for axis in axes for way in some if way[1] // 2 == axis] for p, some in inwards.items()}
            parents = {p: choices[p][0] if p != seed else None for p in sorted(places, key=lambda p: -distance[p])}
            tree = Tree.of(parents, kinds)
            for move in range(moves if free else 1):
                if best is None or len(tree.letters) < len(best.letters):
                    best = tree
                    report(best)
                if len(best.letters) == bound or not free:
                    return best
                tick()
                place = free[rng.integers(len(free))]
                hung = {**parents, place: choices[place][rng.integers(len(choices[place]))]}
                changed = Tree.of(hung, kinds)
                heat = 1 - move / moves  # in letters
                if changed.cost <= tree.cost or rng.random() < math.exp((tree.cost - changed.cost) / heat):
                    parents, tree = hung, changed
    except (TimeoutError, OutOfStepsError):
        if best is None:
            raise
    assert best is not None  # noqa: S101  the first start sets it
    return best


def distances(places: Sequence[Position], seed: Position) -> dict[Position, int]:
    """Bonds from the seed to each place."""
    known, found = set(places), {seed: 0}
    waiting = [seed]
    for place in waiting:
        for p in beside(place):
            if p in known and p not in found:
                found[p] = found[place] + 1
                waiting.append(p)
    return found
