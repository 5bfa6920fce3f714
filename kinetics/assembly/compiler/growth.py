"""Growth of a target from a seed on its lattice: the docking order, and the possible readings of each cube.

For cubes with two face types. Such a cube is known by the axis of its top; it cannot tell left from right, so places
that a turn or a mirror takes into each other look alike to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import permutations, product

from kinetics.assembly.compiler.dockings import Reading
from kinetics.assembly.faces import NORMALS, Position
from kinetics.assembly.rules.conditions import Senses

TOP, SIDE = "f1", "f2"
ROLLS = ("parallel", "crossed")
NOBODY, FREE = -1, -2  # the letter across if there is no cube, or if it is not sensed; that of a free cube
MOST_STATES = 6000  # of one stage; 16 cubes that come in any order make 4,500 or so
Letters = dict[Position, int]


Docking = tuple[Reading, Reading]  # what a bonded cube reads, letters as numbers, and the free one that docks to it
Around = tuple[int, tuple[int, ...]]  # a letter, and those of its neighbours


@dataclass(frozen=True)
class Turn:
    """A rotation or a mirror about the seed: axis i comes from axis source[i], with a sign."""

    source: tuple[int, int, int]
    signs: tuple[int, int, int]

    def of(self, place: Position) -> Position:
        """Where a place comes to lie."""
        (i, j, k), (s, t, u) = self.source, self.signs
        return s * place[i], t * place[j], u * place[k]

    def axis(self, axis: int) -> int:
        """Which axis an axis becomes."""
        return self.source.index(axis)

    def after(self, first: Turn) -> Turn:
        """First that one, then this."""
        source = tuple(first.source[i] for i in self.source)
        signs = tuple(s * first.signs[i] for s, i in zip(self.signs, self.source, strict=True))
        return Turn(source, signs)  # type: ignore[arg-type]  # three of each


TURNS = tuple(Turn(p, s) for p in permutations(range(3)) for s in product((1, -1), repeat=3))  # type: ignore[arg-type]


@cache
def beside(place: Position) -> tuple[Position, ...]:
    """The six places around a place; opposite ones one after the other."""
    x, y, z = place
    return tuple([(x + u, y + v, z + w) for u, v, w in NORMALS])


@dataclass(frozen=True)
class Stage:
    """What comes next, and when.

    senses : of the cubes
    axes : of the tops of all cubes, standing and coming
    standing : the cubes that are there
    coming : place -> the letter that its cube takes as it docks
    required : place -> the places that a coming cube needs to touch, exactly these
    """

    senses: Senses
    axes: Mapping[Position, int]
    standing: Letters
    coming: Mapping[Position, int]
    required: Mapping[Position, frozenset[Position]]


def symmetries(
    turns: Iterable[Turn], letters: Mapping[Position, int], axes: Mapping[Position, int] | None
) -> list[Turn]:
    """The turns that put cubes with these letters, and tops along these axes if given, onto themselves."""

    def fits(turn: Turn) -> bool:
        for place, letter in letters.items():
            image = turn.of(place)
            if letters.get(image) != letter or (axes is not None and axes[image] != turn.axis(axes[place])):
                return False
        return True

    return [turn for turn in turns if fits(turn)]


@dataclass
class Facts:
    """The possible readings during growth, and their required outcomes.

    events : for each cube that is to come, the ways in which it may dock; with its letter
    forbidden : those of cubes that must not come
    internal : what a settled or settling cube reads, and its letter in the next round
    examples : for each way of docking, a place, for messages
    """

    events: dict[frozenset[Docking], int] = field(default_factory=dict)
    forbidden: set[Docking] = field(default_factory=set)
    internal: dict[Around, int] = field(default_factory=dict)
    examples: dict[Docking, Position] = field(default_factory=dict)
    states: int = 0


class TooManyError(Exception):
    """More states of a stage than the cap."""


Follow = Callable[[Position, Letters], int]


def explore_stage(
    stage: Stage,
    turns: Sequence[Turn],
    is_last: bool,
    facts: Facts,
    follow: Follow | None = None,
    most: int = MOST_STATES,
    tick: Callable[[], None] = lambda: None,
) -> Letters:
    """Add the possible readings of a stage to the facts; returns the letters at its end.

    turns : those that leave the lone seed as it is
    is_last : also look at what may not dock to the complete stage (else its letters belong to the next)
    follow : the letter of a cube in the next round of internal rules; None: letters stay
    tick : called at every state, and as it is read; it may raise to end the work
    States that a turn takes into each other are visited once. TooManyError: more than `most` of them.
    """
    same = symmetries(turns, stage.standing, stage.axes)
    alike = symmetries(same, stage.coming, stage.axes)
    lopsided = len(alike) < len(same)  # then which places look alike changes as cubes come
    places = sorted(stage.coming)
    bit = {place: 1 << number for number, place in enumerate(places)}
    images = [[bit[turn.of(place)] for place in places] for turn in alike]
    full = (1 << len(places)) - 1
    letters = dict(stage.standing)
    settle(letters, list(letters), follow, facts)
    unread: list[tuple[Letters, Iterable[Position]]] = [(letters, list(letters))]
    seen = {0}
    waiting = [(0, letters)]
    final, states = letters, 0
    while waiting:
        come, letters = waiting.pop()
        states += 1
        tick()
        for place in places:
            extended = come | bit[place]
            if extended == come or (extended in seen and follow is None) or not _is_due(stage, place, letters):
                continue
            grown = {**letters, place: stage.coming[place]}
            changed = settle(grown, [place], follow, facts)
            if extended in seen:
                continue
            if states + len(waiting) >= most:
                raise TooManyError
            for image in images:
                seen.add(sum([b for number, b in enumerate(image) if extended >> number & 1]))
            if extended == full:
                final = grown
            if extended != full or is_last:
                unread.append((grown, changed))
            waiting.append((extended, grown))
    for state, fresh in unread:  # last, as it takes longer than to find out that there are too many
        tick()
        if lopsided:
            _read(stage, state, state, symmetries(same, state, stage.axes), facts)
        else:
            _read(stage, state, fresh, (), facts)
    facts.states += states
    return final


def settle(letters: Letters, fresh: Iterable[Position], follow: Follow | None, facts: Facts) -> set[Position]:
    """Let the letters follow each other until they rest, reading all that may be read; the places that changed."""
    changed = set(fresh)
    if follow is None:
        return changed
    moved = changed
    while moved:
        near = {p for place in moved for p in (place, *beside(place)) if p in letters}
        following = {}
        for place in near:
            letter = follow(place, letters)
            facts.internal[letters[place], around(place, letters)] = letter
            if letter != letters[place]:
                following[place] = letter
        letters.update(following)
        moved = set(following)
        changed |= moved
    return changed


def around(place: Position, letters: Letters) -> tuple[int, ...]:
    """The letters of the cubes around a place, sorted."""
    return tuple(sorted([letters[p] for p in beside(place) if p in letters]))


def contacts(stage: Stage, letters: Letters, place: Position, axis: int) -> Iterator[Docking]:
    """What a cube and each of its hosts read as it comes to an empty place, its top along an axis."""
    senses = stage.senses
    touched = around(place, letters) if senses.touched else None
    for direction, host in enumerate(beside(place)):
        if host not in letters:
            continue
        along, letter = direction // 2, letters[host]
        own, other = (TOP if top == along else SIDE for top in (axis, stage.axes[host]))
        roll = ROLLS[axis != stage.axes[host]] if senses.roll else None
        across = letters.get(beside(host)[direction], NOBODY) if senses.across else NOBODY
        yield (
            Reading(letter, other, around(host, letters), across, FREE, own, roll, None),
            Reading(FREE, own, (), NOBODY, letter, other, roll, touched),
        )


def _is_due(stage: Stage, place: Position, letters: Letters) -> bool:
    """Whether a cube may come to that place now: what it needs is there, and nothing else."""
    return {p for p in beside(place) if p in letters} == stage.required[place]


def _read(
    stage: Stage, letters: Letters, changed: Iterable[Position], symmetries: Iterable[Turn], facts: Facts
) -> None:
    """Collect what may be read at the empty places near some cubes.

    symmetries : turns of the structure as it stands; what they make of a place that is due is due as well
    """
    due = {(p, stage.axes[p]) for p in stage.coming if p not in letters and _is_due(stage, p, letters)}
    due |= {(turn.of(p), turn.axis(axis)) for turn in symmetries for p, axis in due}
    wanted = {p: letter for p, letter in stage.coming.items() if (p, stage.axes[p]) in due}
    hosts = {p for place in changed for p in (place, *beside(place)) if p in letters}
    for place in {p for host in hosts for p in beside(host) if p not in letters}:
        for axis in range(3):
            met = frozenset(contacts(stage, letters, place, axis))
            for contact in met:
                facts.examples.setdefault(contact, place)
            if (place, axis) not in due:
                facts.forbidden |= met
            elif place in wanted and stage.axes[place] == axis:
                facts.events[met] = wanted[place]
