"""Whether fewer letters do: a search over rules, not letters, that shares no code with the compiler.

Free cubes meet; where nothing is settled yet about what a cube reads, every answer is tried; and an answer falls with
the first structure that is no part of the target.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

from kinetics.assembly.faces import Position, roll, scheme_of
from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.structure import Structure, placements

STEPS = 1_000_000
BLANK = "#"
NAMES = "abcdefgh"
Reading = tuple[object, ...]
Shape = tuple[tuple[Position, ...], tuple[int, ...]]
Made = tuple[Structure, Structure, Structure]  # the bare shapes of two structures, and of what they make


class StepsError(Exception):
    """The search has used up its steps."""


class Searched(NamedTuple):
    """The rules of a book with so many letters, None where there is none; and the answers that were tried."""

    letters: int
    rules: Mapping[Reading, str] | None
    steps: int


class _End(NamedTuple):
    """What a cube of a structure shows as it docks, by the places of the letters that it reads."""

    cube: int
    face: str
    near: tuple[int, ...]
    behind: int | None
    touched: tuple[int, ...]


class _Meeting(NamedTuple):
    """One way in which two structures can meet; bare: the shape that they make, None: no part of the target."""

    ends: tuple[_End, _End]
    twist: str
    shape: Shape
    bare: Structure | None


@dataclass
class BookSearch:
    """A search for any book of so many letters that builds the target and parts of it alone.

    one_lettering : only books in which all structures of one shape have the same letters, also in places that symmetry
        exchanges, and a join happens in all its ways; else any book
    joins : those that the book must have, and no others, by bare shapes; None: any
    Both cubes must have a rule to bond, and both read before either writes; internal rules follow at once, all cubes at
    a time. From every structure there must be events to the target. Cost: exponential in the number of rules.
    """

    target: Structure
    senses: Senses
    breaks: bool
    letters: int
    one_lettering: bool = True
    joins: frozenset[Made] | None = None
    most_steps: int = STEPS
    steps: int = 0
    rules: dict[Reading, tuple[str, int]] = field(default_factory=dict)  # the answer, and the bit that stands for it

    def __post_init__(self) -> None:
        self.scheme = self.senses.faces
        whole = self.bare(self.target)
        self.pieces = {
            piece
            for size in range(1, len(whole) + 1)
            for members in combinations(range(len(whole)), size)
            if (piece := self.piece(whole, members)) is not None
        }
        self.whole = whole
        self.splits = [
            (*sorted((one, two), key=repr), piece)
            for piece in sorted(self.pieces, key=len)
            for size in range(1, len(piece))
            for members in combinations(range(len(piece)), size)
            if 0 in members
            and (one := self.piece(piece, members)) is not None
            and (two := self.piece(piece, tuple(n for n in range(len(piece)) if n not in members))) is not None
        ]
        self.order: list[Structure] = []
        self.known: dict[Structure, int] = {}
        self.shapes: dict[Structure, int] = {}
        self.todo: list[tuple[int, ...]] = []  # structures that meet, the number of the meeting; or a bond that breaks
        self.events: list[tuple[tuple[int, ...], tuple[int, ...]]] = []
        self.met: dict[tuple[Shape, Shape], list[_Meeting]] = {}
        self.opened: dict[Made, tuple[bool, int]] = {}
        self.reasons: list[int] = []  # the rules by which each structure was made first

    def search(self) -> Searched:
        """Search it all; StepsError where it takes too long."""
        self.used = 0
        self.enter(Structure(((0, 0, 0),), (0,), (NAMES[0],)))
        if self.go_on(0) is not None:
            return Searched(self.letters, None, self.steps)
        return Searched(self.letters, {reading: answer for reading, (answer, _) in self.rules.items()}, self.steps)

    def piece(self, whole: Structure, members: tuple[int, ...]) -> Structure | None:
        """The shape of these cubes; None where they do not hang together."""
        try:
            return self.bare(whole.part(members))
        except ValueError:
            return None

    def bare(self, structure: Structure) -> Structure:
        """The shape, in canonical form."""
        return structure.with_letters((BLANK,) * len(structure)).canonical(self.scheme)

    def go_on(self, n: int) -> int | None:
        """Complete the rules so that all goes well from the n-th thing to do on: None where that works, else the rules
        that cannot all stay, as bits.

        Of the rules before, only those are tried again that have a part in a fault (conflict-directed backjumping;
        Prosser 1993, doi:10.1111/j.1467-8640.1993.tb00310.x).
        """
        marks = len(self.order), len(self.todo), len(self.events)
        opened = dict(self.opened)
        try:
            while n < len(self.todo):
                self.happen(self.todo[n])
                n += 1
            if self.goes_home():
                return None
            guilty = (1 << len(self.rules)) - 1
        except _FaultError:
            guilty = self.used
        except _OpenError as error:
            guilty, bit = 0, 1 << len(self.rules)
            for answer in self.answers(error.reading):
                self.steps += 1
                if self.steps > self.most_steps:
                    raise StepsError from None
                self.rules[error.reading] = answer, bit
                found = self.go_on(n)
                if found is None:
                    return None
                del self.rules[error.reading]
                guilty |= found
                if not found & bit:
                    guilty = found
                    break
            guilty &= ~bit
        for structure in self.order[marks[0] :]:
            del self.known[structure]
        self.shapes = {shape: number for shape, number in self.shapes.items() if number < marks[0]}
        del self.order[marks[0] :], self.reasons[marks[0] :], self.todo[marks[1] :], self.events[marks[2] :]
        self.opened = opened
        return guilty

    def answers(self, reading: Reading) -> Iterator[str]:
        """What a cube may do; of the letters that were never used, the first stands for all."""
        if reading[0] == "join":
            yield ""
        used = {NAMES[0], *(answer for answer, _ in self.rules.values())}
        fresh = [name for name in NAMES[: self.letters] if name not in used]
        yield from [name for name in NAMES[: self.letters] if name in used]
        yield from fresh[:1]

    def enter(self, structure: Structure) -> int:
        """The number of a structure, after its internal rules; a new one has new things to do."""
        made = self.at_rest(structure).canonical(self.scheme)
        if made in self.known:
            return self.known[made]
        bare = self.bare(made)
        other = self.shapes.setdefault(bare, len(self.order))
        if self.one_lettering and other != len(self.order):
            self.used |= self.reasons[other]
            raise _FaultError
        if self.one_lettering and made.symmetry_number(self.scheme) != bare.symmetry_number(self.scheme):
            raise _FaultError  # places that symmetry exchanges have unlike letters
        self.known[made] = number = len(self.order)
        self.order.append(made)
        self.reasons.append(self.used)
        for other in range(number + 1):
            self.todo += [(number, other, n) for n in range(len(self.meetings(made, self.order[other])))]
        if self.breaks:
            self.todo += [(number, *bond, -1) for bond in made.bonds if made.sides(*bond) is not None]
        return number

    def happen(self, thing: tuple[int, ...]) -> None:
        """A meeting or a break, with all that follows at once."""
        self.used = 0
        if len(thing) == 4:
            a, i, j, _ = thing
            before: tuple[int, ...] = (a,)
            self.used = self.reasons[a]
            made = self.broken(self.order[a], i, j)
        else:
            before, made = thing[:2], self.joined(*thing)
        if made:
            self.events.append((before, tuple([self.enter(structure) for structure in made])))

    def joined(self, n: int, m: int, number: int) -> list[Structure]:
        """What two structures make in one of their ways to meet, if anything."""
        a, b = self.order[n], self.order[m]
        meeting = self.meetings(a, b)[number]
        letters = a.letters, b.letters
        readings = [
            self.reading(end, own, other, face.face, meeting.twist)
            for end, face, own, other in zip(meeting.ends, meeting.ends[::-1], letters, letters[::-1], strict=True)
        ]
        refused = [self.rules[reading] for reading in readings if self.rules.get(reading, ("?",))[0] == ""]
        self.used = self.reasons[n] | self.reasons[m]
        becomes = []
        if refused:
            self.used |= refused[0][1]
        else:
            for reading in readings:
                becomes.append(self.answer(reading))
                if not becomes[-1]:
                    break
        does_bond = bool(becomes) and becomes[-1] != ""
        if meeting.bare is not None:
            self.decide(self.bare(a), self.bare(b), meeting.bare, does_bond)
        if not does_bond:
            return []
        if meeting.bare is None:
            raise _FaultError
        new = [*a.letters, *b.letters]
        new[meeting.ends[0].cube], new[len(a) + meeting.ends[1].cube] = becomes
        return [Structure.unchecked(*meeting.shape, tuple(new))]

    def decide(self, a: Structure, b: Structure, made: Structure, does_bond: bool) -> None:
        """A join happens in all its ways or in none, where that is asked, and only if it may."""
        one, two = sorted((a, b), key=repr)
        key = one, two, made
        if self.joins is not None and does_bond != (key in self.joins):
            raise _FaultError
        if self.one_lettering:
            is_new = key not in self.opened
            known, why = self.opened.setdefault(key, (does_bond, self.used))
            if known != does_bond:
                self.used |= why
                raise _FaultError
            if is_new and not known and not self.is_hopeful():
                for other, reasons in self.opened.values():
                    self.used |= 0 if other else reasons
                raise _FaultError

    def is_hopeful(self) -> bool:
        """Whether joins that nothing is decided about may still make the target."""
        found, size = {piece for piece in self.pieces if len(piece) == 1}, 0
        while len(found) > size:
            size = len(found)
            for a, b, made in self.splits:
                if a in found and b in found and self.opened.get((a, b, made), (True, 0))[0]:
                    found.add(made)
        return self.whole in found

    def reading(self, end: _End, own: tuple[str, ...], other: tuple[str, ...], face: str, twist: str) -> Reading:
        """All that a cube reads as it docks."""
        near = tuple(sorted([own[n] for n in end.near]))
        across = "" if end.behind is None else own[end.behind]
        touched = tuple(sorted([other[n] for n in end.touched[1:]]))
        return "join", own[end.cube], end.face, near, other[end.touched[0]], face, across, twist, touched

    def meetings(self, a: Structure, b: Structure) -> list[_Meeting]:
        """The ways in which two structures meet, those once that look alike."""
        key = (a.positions, a.rotations), (b.positions, b.rotations)
        if key not in self.met:
            bare = [s.with_letters([f"{n}{cube}" for cube in range(len(s))]) for n, s in enumerate((a, b))]
            found: dict[object, _Meeting] = {}
            for i, face in a.open_faces():
                for j, other in b.open_faces():
                    for placement in placements(a, i, face, bare[1], j, other):
                        placed = bare[1].moved(placement)
                        if a.places.keys().isdisjoint(placed.places):
                            meeting = self.meeting(bare[0], i, face, placed, j, other)
                            made = bare[0].joined(placed).canonical(self.scheme)
                            found.setdefault((meeting.ends, meeting.twist, made), meeting)
            self.met[key] = list(found.values())
        return self.met[key]

    def meeting(self, a: Structure, i: int, face: int, b: Structure, j: int, other: int) -> _Meeting:
        """One way, with b where it docks."""
        made = a.joined(b)
        shape = self.bare(made)
        return _Meeting(
            (self.end(a, i, face, b, j), self.end(b, j, other, a, i)),
            roll(self.scheme, a.rotations[i], face, b.rotations[j]) if self.senses.roll else "",
            (made.positions, made.rotations),
            shape if shape in self.pieces else None,
        )

    def end(self, own: Structure, cube: int, face: int, other: Structure, partner: int) -> _End:
        """What one cube shows; touched: the partner, then all that it touches if it senses them."""
        behind = own.cube_at(own.faced(cube, face ^ 1)) if self.senses.across else None
        touched = tuple(sorted(other.touching(own.positions[cube]))) if self.senses.touched else ()
        near = tuple(sorted(own.neighbours(cube)))
        return _End(cube, scheme_of(self.scheme).types[face], near, behind, (partner, *touched))

    def broken(self, whole: Structure, i: int, j: int) -> list[Structure]:
        """What is left when a bond breaks."""
        sides = whole.sides(i, j)
        assert sides is not None  # noqa: S101  only such bonds are tried
        letters = list(whole.letters)
        for own, gone in ((i, j), (j, i)):
            near = tuple(sorted(whole.letters[n] for n in whole.neighbours(own) if n != gone))
            letters[own] = self.answer(("break", whole.letters[own], near, whole.letters[gone]))
        after = whole.with_letters(letters)
        return [after.part(side) for side in sides]

    def at_rest(self, structure: Structure) -> Structure:
        """The structure after its internal rules; a lone cube with the first letter is a free one and stays so."""
        seen: set[tuple[str, ...]] = set()
        letters = structure.letters
        while letters not in seen:
            seen.add(letters)
            near = [tuple(sorted([letters[n] for n in structure.neighbours(c)])) for c in range(len(letters))]
            following = tuple(
                [
                    own if (own, around) == (NAMES[0], ()) else self.answer(("follow", own, around))
                    for own, around in zip(letters, near, strict=True)
                ]
            )
            if following == letters:
                return structure.with_letters(letters)
            letters = following
        raise _FaultError

    def answer(self, reading: Reading) -> str:
        """What is settled about a reading."""
        if reading not in self.rules:
            raise _OpenError(reading)
        answer, bit = self.rules[reading]
        self.used |= bit
        return answer

    def goes_home(self) -> bool:
        """Whether the target is made, bonds no more, and every structure can become it."""
        made = [number for number, structure in enumerate(self.order) if self.bare(structure) == self.whole]
        grows = any(set(before) & set(made) for before, _ in self.events if len(before) == 2)
        if not made or grows or (self.joins or set()) - {key for key, (yes, _) in self.opened.items() if yes}:
            return False
        home, size = set(made), 0
        while len(home) > size:
            size = len(home)
            home |= {n for before, after in self.events if home.intersection(after) for n in before}
        return len(home) == len(self.order)


class _FaultError(Exception):
    """The rules do what they must not."""


class _OpenError(Exception):
    """Nothing is settled about a reading."""

    def __init__(self, reading: Reading):
        super().__init__(reading)
        self.reading = reading
