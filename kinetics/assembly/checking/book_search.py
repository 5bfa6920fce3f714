"""Whether a number of letters suffices: a search over rules that shares no code with the compiler.

Pieces of the target meet; if nothing is settled yet about what a cube reads, every answer is tried; and an answer
falls with the first structure that is no piece of the target, or that comes with other letters than before.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import combinations, product
from typing import Any, NamedTuple

from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure, placements

FREE, NAMES = "a", "abcdefgh"
Reading = tuple[tuple[str, ...], ...]  # all but letters; a cube's own; its neighbours', sorted; its partner's; and more
Join = tuple[int, int, int]  # two pieces, the smaller number first, and what they make


class PieceEvent(NamedTuple):
    """Two pieces meet, or one breaks; cubes have names in place of letters.

    after : if both cubes answer, the pieces, each with its cubes; those that answer are `0` and `1`
    """

    before: tuple[int, ...]
    readings: Sequence[Reading]
    after: Sequence[tuple[int, tuple[str, ...]]]  # piece -1: no piece of the target


class Pieces:
    """The connected pieces of a target up to rotation, the free cube first and the target last, and their joins.

    shapes : the letters are names of the cubes, one name for those that symmetry exchanges
    """

    def __init__(self, target: Structure, senses: Senses):
        self.size, self.scheme, self.reader = len(target), senses.faces, RuleBook("reader", ("a",), "a", senses)
        groups = {frozenset({cube}) for cube in range(len(target))}
        for _ in range(len(target)):
            groups |= {group | {n} for group in groups for cube in group for n in target.neighbours(cube)}
        shapes = {group: _bare(target.part(sorted(group))).canonical(self.scheme) for group in groups}
        self.number = {shape: n for n, shape in enumerate(sorted({*shapes.values()}, key=lambda s: (len(s), repr(s))))}
        self.shapes = []
        for shape, n in self.number.items():
            turns = shape.symmetries(self.scheme)
            firsts = [min(shape.places[turn.of(place)] for turn in turns) for place in shape.positions]
            self.shapes.append(shape.with_letters([f"{n}.{cube}" for cube in firsts]))
        self.joins: set[Join] = set()
        for one, two in combinations(groups, 2):
            if one | two in groups and not one & two:
                a, b, made = (self.number[shapes[group]] for group in (one, two, one | two))
                self.joins.add((min(a, b), max(a, b), made))
        self.falls = [list(self._falls(whole)) for whole in range(len(self.shapes))]
        self._met: dict[tuple[int, int], list[PieceEvent]] = {}

    def placed(self, structure: Structure) -> tuple[int, tuple[str, ...]]:
        """Which piece a structure is, -1 for none; and its letters in the order of the piece's cubes."""
        bare = _bare(structure)
        in_order = sorted(zip(bare.canonical_cubes(self.scheme), structure.letters, strict=True))
        return self.number.get(bare.canonical(self.scheme), -1), tuple([letter for _, letter in in_order])

    def docking(self, one: Structure, i: int, two: Structure, j: int) -> PieceEvent:
        """Cube i of a piece, with its names, next to cube j of another. ValueError if they overlap or do not touch."""
        if not one.places.keys().isdisjoint(two.places):
            raise ValueError(f"{one} and {two} overlap")
        a, b = sorted(int(side.letters[0].split(".")[0]) for side in (one, two))
        faces = one.face_towards(i, two.positions[j]), two.face_towards(j, one.positions[i])
        views: Any = self.reader.view(one, i, faces[0], two, j), self.reader.view(two, j, faces[1], one, i)
        readings = [
            (
                ("join", own.face, other.face, own.roll or ""),
                (own.letter,),
                own.neighbours,
                (other.letter,),
                (own.across,) if own.across else (),
                own.touched or (),
            )
            for own, other in (views, views[::-1])
        ]
        made = _marked(one.joined(two), i, len(one) + j)
        return PieceEvent((a, b), readings, [self.placed(made) if len(made) <= self.size else (-1, ())])

    def meetings(self, a: int, b: int) -> list[PieceEvent]:
        """The ways in which two pieces meet; equivalent ways count once."""
        if (a, b) not in self._met:
            one, two = self.shapes[a], self.shapes[b]
            firsts = [
                [site for site in s.open_faces() if s.letters[site[0]].endswith(f".{site[0]}")] for s in (one, two)
            ]
            found = {}
            for (i, face), (j, other) in product(*firsts):
                for placed in map(two.moved, placements(one, i, face, two, j, other)):
                    if one.places.keys().isdisjoint(placed.places):
                        event = self.docking(one, i, placed, j)
                        found[repr(event)] = event
            self._met[a, b] = list(found.values())
        return self._met[a, b]

    def _falls(self, whole: int) -> Iterator[PieceEvent]:
        shape = self.shapes[whole]
        names = shape.letters
        for i, j in shape.bonds:
            if sides := shape.sides(i, j):
                near = [tuple(sorted([names[n] for n in shape.neighbours(c) if n not in (i, j)])) for c in (i, j)]
                readings = [(("break",), (names[c],), near[c == j], (names[i + j - c],)) for c in (i, j)]
                yield PieceEvent((whole,), readings, [self.placed(_marked(shape, i, j).part(side)) for side in sides])

    def can_make_target(self, without: Collection[Join], breaks: bool) -> bool:
        """Whether there is a way from free cubes to the target that leaves out some joins, and makes only what may
        become part of the target itself, and falls apart into the like.
        """
        target = len(self.shapes) - 1
        left, falls = self.joins.difference(without), self.falls if breaks else [[] for _ in self.shapes]
        parts = [{part for event in events for part, _ in event.after} for events in falls]
        while True:
            made, home, size = {0}, {target}, -1
            while len(made) + len(home) > size:
                size = len(made) + len(home)
                made |= {c for a, b, c in left if a in made and b in made}.union(*(parts[piece] for piece in made))
                home |= {piece for a, b, c in left if c in home and {a, b} <= made for piece in (a, b)}
                home |= {piece for piece in made if parts[piece] & home}
            lost = {piece for piece in made if piece not in home or not parts[piece] <= home}
            kept = {join for join in left if join[2] not in lost}
            if kept == left:
                return target in made and not lost
            left = kept


def _bare(structure: Structure) -> Structure:
    return structure.with_letters(("#",) * len(structure))


def _marked(structure: Structure, i: int, j: int) -> Structure:
    return structure.with_letters([{i: "0", j: "1"}.get(cube, name) for cube, name in enumerate(structure.letters)])


class _State(NamedTuple):
    """What follows from the rules so far; facts come with the rules that they follow from, as bits."""

    letters: dict[str, str]  # of the cubes of the pieces that are made
    made: dict[int, int]
    todo: list[PieceEvent]
    joins: dict[Join, tuple[bool, int]]  # whether they happen
    moves: set[tuple[str, str]]  # which cubes become which

    def copy(self) -> _State:
        return _State(self.letters.copy(), self.made.copy(), self.todo.copy(), self.joins.copy(), self.moves.copy())


class BookSearch:
    """A search for any book of so many letters that makes a target and pieces of it alone, all of which can become it.

    joins : those that the book must have, and no others; None: any
    Kind of books: both cubes must have a rule to bond, and both read before either writes; internal rules follow at
    once, all cubes at a time; all structures of one shape have the same letters, and so have places that symmetry
    exchanges; a join happens in all its ways or in none. Cost: exponential in the number of rules.
    """

    def __init__(self, pieces: Pieces, breaks: bool, letters: int, joins: Collection[Join] | None = None):
        self.pieces, self.breaks, self.names = pieces, breaks, NAMES[:letters]
        self.asked = {} if joins is None else {join: (join in joins, 0) for join in pieces.joins}
        # a free cube stays free; with each answer, the bit that stands for the rule
        self.rules: dict[Reading, tuple[str, int]] = {(("follow",), (FREE,), ()): (FREE, 0)}
        self.used = self.steps = 0

    def finds_one(self, most_steps: int) -> bool | None:
        """Whether there is such a book, by its `rules` then; None: not decided with so many answers tried."""
        self.most_steps, state = most_steps, _State({}, {}, [], self.asked.copy(), set())
        self._enter(state, 0, (FREE,))
        try:
            return self._go_on(state, 0) is None
        except (TimeoutError, RecursionError):
            return None

    def _go_on(self, state: _State, n: int) -> int | None:
        """Complete the rules so that all goes well from the n-th thing to do on: None if that works, else the rules
        that cannot all stay. Of the rules before, only those are tried again that have a part in a fault
        (conflict-directed backjumping; Prosser 1993, doi:10.1111/j.1467-8640.1993.tb00310.x).
        """
        guilty, bit = 0, 1 << len(self.rules)
        try:
            while n < len(state.todo):
                self._happen(state, state.todo[n])
                n += 1
            return None if self._goes_home(state) else bit - 1
        except _Stopped as stopped:
            reading: Reading = stopped.args
        if not reading:
            return self.used
        known = {FREE, *(answer for answer, _ in self.rules.values())}
        fresh = [name for name in self.names if name not in known]
        answers = [name for name in self.names if name in known] + fresh[:1]
        for answer in ["", *answers] if reading[0][0] == "join" else answers:  # "": no bond
            self.steps += 1
            if self.steps > self.most_steps:
                raise TimeoutError
            self.rules[reading] = answer, bit
            found = self._go_on(state.copy(), n)
            if found is None:
                return None
            del self.rules[reading]
            if not found & bit:
                return found
            guilty |= found
        return guilty & ~bit

    def _answer(self, reading: Reading) -> str:
        if reading not in self.rules:
            raise _Stopped(*reading)
        self.used |= self.rules[reading][1]
        return self.rules[reading][0]

    def _happen(self, state: _State, event: PieceEvent) -> None:
        """A meeting or a break, with all that follows at once."""
        self.used = 0
        for piece in event.before:
            self.used |= state.made[piece]
        letters = state.letters
        readings: list[Reading] = [
            (seen, *[tuple(sorted([letters[name] for name in names])) for names in read])
            for seen, *read in event.readings
        ]
        refused = [reading for reading in readings if self.rules.get(reading, ("?",))[0] == ""][:1]
        answers = [self._answer(reading) for reading in refused or readings]
        if len(event.before) == 2:
            self._decide(state, (*event.before, event.after[0][0]), not refused)
        becomes = letters | dict(zip("01", answers, strict=False))
        cubes = {str(n): names[0] for n, (_, names, *_) in enumerate(event.readings)}
        for piece, names in () if refused else event.after:
            self._enter(state, piece, tuple([becomes[name] for name in names]))
            state.moves.update(zip([cubes.get(n, n) for n in names], self.pieces.shapes[piece].letters, strict=True))

    def _decide(self, state: _State, join: Join, happens: bool) -> None:
        """A join makes a piece, in all its ways or in none; and those that are left can make the target."""
        known, why = (False, 0) if join[2] < 0 else state.joins.setdefault(join, (happens, self.used))
        refused = {other: reasons for other, (is_made, reasons) in state.joins.items() if not is_made}
        if known != happens:
            self.used |= why
            raise _Stopped
        if not happens and not self.pieces.can_make_target(refused, self.breaks):
            for why in refused.values():
                self.used |= why
            raise _Stopped

    def _enter(self, state: _State, piece: int, letters: tuple[str, ...]) -> None:
        """A piece is made, and the internal rules follow; a new one has new things to do."""
        shape, seen = self.pieces.shapes[piece], list[tuple[str, ...]]()
        while letters not in seen:
            seen.append(letters)
            near = [tuple(sorted([letters[n] for n in shape.neighbours(cube)])) for cube in range(len(letters))]
            letters = tuple(
                [self._answer((("follow",), (own,), around)) for own, around in zip(letters, near, strict=True)]
            )
        given = state.letters if piece in state.made else dict(zip(shape.letters, letters, strict=True))
        if letters != seen[-1] or letters != tuple([given[name] for name in shape.letters]):
            self.used |= state.made.get(piece, 0)
            raise _Stopped
        if piece not in state.made:
            state.letters.update(given)
            state.made[piece] = self.used
            for other in state.made:
                state.todo.extend(self.pieces.meetings(min(piece, other), max(piece, other)))
            state.todo.extend(self.pieces.falls[piece] if self.breaks else ())

    def _goes_home(self, state: _State) -> bool:
        """Whether some way leads every cube into the target."""
        target, size = len(self.pieces.shapes) - 1, 0
        home = set(self.pieces.shapes[target].letters if target in state.made else ())
        while len(home) > size:
            size = len(home)
            home |= {before for before, after in state.moves if after in home}
        return home.issuperset(state.letters)


class _Stopped(Exception):  # noqa: N818  it is no error
    """The rules fail; or, with arguments, they are undecided for this reading."""
