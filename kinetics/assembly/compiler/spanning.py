"""Growth along a spanning tree: six distinct faces and the twist suffice for any target.

A cube's letter tells which subtree hangs on it, up to rotation, so each of its faces takes one kind of cube at one
face and one twist, whatever else is there. Few letters means a tree with few different subtrees. A path from the seed
to a leaf shows no subtree twice, so it takes at least as many letters as the seed is bonds from the farthest cube,
and one more; and that of a free cube.
"""

from __future__ import annotations

import math
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

    parents : place -> the place nearer to the seed; the seed has none
    hung : place -> the subtree that hangs on it
    kinds : what the numbers of the subtrees mean
    """

    parents: dict[Position, Position]
    hung: dict[Position, Hung]
    kinds: Kinds

    @cached_property
    def letters(self) -> list[int]:
        """The kinds of subtrees that occur; the seed's first."""
        return sorted({kind for kind, _ in self.hung.values()}, reverse=True)

    @cached_property
    def rotations(self) -> dict[Position, int]:
        """How each cube is turned: as the rules make it come, from the seed on."""
        seed = next(place for place in self.hung if place not in self.parents)
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
                twist = roll("six", turn, own, 0)
                faces = {"face": (f"f{own + 1}",), "partner_face": (f"f{face + 1}",), "roll": (twist,)}
                host = {"face": faces["partner_face"], "partner_face": faces["face"], "roll": faces["roll"]}
                found += [
                    Combination(
                        rule=f"{FREE} docks at f{face + 1} of {names[kind]}",
                        letter=(FREE,),
                        partner=(names[kind],),
                        becomes=names[child],
                        **faces,
                    ),
                    Combination(
                        rule=f"{names[kind]} takes {FREE} on f{face + 1}",
                        letter=(names[kind],),
                        partner=(FREE,),
                        becomes=names[kind],
                        **host,
                    ),
                ]
        return found


def centre(places: Sequence[Position]) -> Position:
    """The place from which the farthest one is nearest; of several, the most central and first."""
    middle = [(min(c) + max(c)) / 2 for c in zip(*places, strict=True)]
    return min(places, key=lambda place: (max(distances(places, place).values()), math.dist(place, middle), place))


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
    Ctrl-C, or an error of `tick` that time or steps are used up, ends the search; the best tree so far is returned.
    """
    best: Tree | None = None
    bound = max(distances(places, seed).values()) + 1
    try:
        for order in 2 * list(permutations(range(3))):
            search = _TreeSearch(places, seed, order)
            cost = search.cost()
            free = [place for place, choices in search.choices.items() if len(choices) > 1]
            for move in range(moves if free else 1):
                if best is None or len(search.counts) < len(best.letters):
                    best = search.tree()
                    report(best)
                if len(best.letters) == bound or not free:
                    return best
                tick()
                place = free[rng.integers(len(free))]
                old, choices = search.parents[place], search.choices[place]
                search.hang(place, choices[rng.integers(len(choices))])
                changed = search.cost()
                heat = 1 - move / moves  # in letters
                if changed <= cost or rng.random() < math.exp((cost - changed) / heat):
                    cost = changed
                else:
                    search.hang(place, old)
    except (KeyboardInterrupt, TimeoutError, OutOfStepsError):
        if best is None:
            raise
    assert best is not None  # noqa: S101  the first start sets it
    return best


class _TreeSearch:
    """A tree of shortest paths under change.

    choices : place -> the places that it may hang on
    order : of the axes; at first, a cube hangs on the neighbour along the first of them
    """

    def __init__(self, places: Sequence[Position], seed: Position, order: Sequence[int]):
        distance = distances(places, seed)
        self.kinds = Kinds()
        self.choices = {
            place: sorted(
                (p for p in beside(place) if distance.get(p, len(places)) < distance[place]),
                key=lambda p, place=place: order[beside(place).index(p) // 2],  # type: ignore[misc]
            )
            for place in places
            if place != seed
        }
        self.parents = {place: choices[0] for place, choices in self.choices.items()}
        self.children: dict[Position, set[Position]] = {place: set() for place in places}
        for place, parent in self.parents.items():
            self.children[parent].add(place)
        self.hung: dict[Position, Hung] = {}
        self.counts: dict[int, int] = {}
        for place in sorted(places, key=lambda p: -distance[p]):
            self.refresh(place)

    def refresh(self, place: Position) -> bool:
        """Find out what hangs on a place now; whether that is something else."""
        branches = tuple(sorted((beside(place).index(child), *self.hung[child]) for child in self.children[place]))
        now, before = self.kinds.of(branches), self.hung.get(place)
        if now == before:
            return False
        if before is not None:
            self.counts[before[0]] -= 1
            if not self.counts[before[0]]:
                del self.counts[before[0]]
        self.hung[place] = now
        self.counts[now[0]] = self.counts.get(now[0], 0) + 1
        return True

    def hang(self, place: Position, parent: Position) -> None:
        """Hang a cube, with all that hangs on it, on another one."""
        old = self.parents[place]
        self.children[old].discard(place)
        self.children[parent].add(place)
        self.parents[place] = parent
        for start in (old, parent):
            above: Position | None = start
            while above is not None and self.refresh(above):
                above = self.parents.get(above)

    def cost(self) -> float:
        """Letters; and of as many, better those with a rare kind, which may go next."""
        return len(self.counts) + sum(1 / n for n in self.counts.values())

    def tree(self) -> Tree:
        return Tree(dict(self.parents), dict(self.hung), self.kinds)


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
