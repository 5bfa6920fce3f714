"""The exact search: letters for every part and rules for every event, with the fewest letters possible.

What is sought: one letter for each unknown of a plan and three tables of rules, such that
- the joins asked for are open, both cubes having a rule, and no other meeting of two parts is;
- after every join and every break, internal rules lead to the letters of what was made, and none acts in it then.
Each part has one set of letters, and a free cube's may stand in larger parts, where its neighbours tell it apart.
Cubes that join or lose a bond, and those that follow, write their final letter at once unless another event that looks
the same to them has settled otherwise; `deferred` lets them write any letter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from kinetics.assembly.compiler.choices import sensible
from kinetics.assembly.compiler.plan import Channel, Docking, Loss, Reading, Wave
from kinetics.assembly.compiler.problem import Problem, shown_of

MOST_LETTERS = 15
BITS = 4  # a letter; in a multiset, the count of a letter takes three
Key = int
_Terms = tuple[int, tuple[int, ...], tuple[int, ...], tuple[int, ...]]  # kind of reading, then unknowns
_NOTHING = object()


@dataclass(frozen=True, eq=False)
class Solution:
    """A solution, letters as numbers, 0 that of a free cube.

    joins : those that are open; parts : those that there are
    letters : of each unknown of these parts
    joined, lost : what each reading makes of a cube
    followed : (letter, neighbours) -> letter
    """

    joins: tuple[Channel, ...]
    parts: tuple[int, ...]
    letters: dict[int, int]
    joined: dict[Reading, int]
    lost: dict[Loss, int]
    followed: dict[tuple[int, tuple[int, ...]], int]


def solutions(
    problem: Problem, n_letters: int, deferred: bool = False, tick: Callable[[], None] = lambda: None
) -> Iterator[Solution]:
    """All solutions with at most that many letters, none twice by other names of the letters.

    tick : called again and again; it may raise to end the search
    """
    if not 1 <= n_letters <= MOST_LETTERS:
        raise ValueError(f"{n_letters} letters; the search takes 1 to {MOST_LETTERS}")
    return _LetterSearch(problem, n_letters, deferred, tick).run()


class _Chosen(NamedTuple):
    """The joins decided so far, and the parts that there are."""

    joins: frozenset[Channel]
    refused: frozenset[Channel]
    parts: tuple[int, ...]


class _LetterSearch:
    """Depth first, a part at a time; what was decided on the way is on a trail, to be undone."""

    def __init__(self, problem: Problem, n_letters: int, deferred: bool, tick: Callable[[], None]):
        self.problem, self.n_letters, self.deferred, self.tick = problem, n_letters, deferred, tick
        self.letters: dict[int, int] = {}
        self.joined: dict[Key, int | None] = {}  # open readings; None: what they make is not settled yet
        self.excluded: dict[Key, dict[Key, None]] = {}  # readings that must not be open along with a key
        self.lost: dict[Key, int] = {}
        self.followed: dict[Key, int] = {}
        self.trail: list[tuple[dict[Key, Any], Key, Any]] = []  # what was in a table before
        plan = problem.plan
        self.around = {
            p: [plan.parts[p].structure.neighbours(c) for c in range(len(plan.parts[p]))] for p in problem.parts
        }
        self.kinds = problem.shown
        self.known_terms: dict[Reading, _Terms] = {}
        self.known_shut: dict[object, tuple[list[_Terms], list[tuple[int, int]]]] = {}
        self.left_by_breaks: frozenset[int] = (
            frozenset().union(*plan.pieces.values()) if problem.breaks else frozenset()
        )

    def run(self) -> Iterator[Solution]:
        """Search from the free cube on."""
        (free,) = self.problem.plan.parts[0].unknowns
        self.letters[free] = 0
        return self.part(0, 0, _Chosen(frozenset(), frozenset(), ()))

    def part(self, level: int, highest: int, chosen: _Chosen) -> Iterator[Solution]:
        """Solutions that go on from the parts before; letters up to `highest` are in use."""
        problem = self.problem
        if level == len(problem.parts):
            if chosen.joins and sensible(problem.plan, chosen.joins, problem.breaks) == chosen.joins:
                yield self.tables(chosen)
            return
        number = problem.parts[level]
        is_made = number == 0 or any(join.c == number for join in chosen.joins)
        if not is_made:
            yield from self.without(level, highest, chosen)
            if number not in self.left_by_breaks:
                return
        if problem.breaks and not problem.plan.pieces[number] <= {*chosen.parts}:
            return
        unknowns = sorted(set(problem.plan.parts[number].unknowns))
        reached = chosen._replace(parts=(*chosen.parts, number))
        following = [channel for b in reached.parts for channel in problem.joins_of(number, b)]
        for letters in [(0,)] if level == 0 else _namings(len(unknowns), highest, self.n_letters):
            self.tick()
            self.letters.update(zip(unknowns, letters, strict=True))
            mark = len(self.trail)
            if self.rests(number) and all(self.shuts((number, b), problem.foreign(number, b)) for b in reached.parts):
                waves = self.waves(number, reached)
                for decided in self.joins(following, 0, reached):
                    for _ in self.wave(waves, 0):
                        yield from self.part(level + 1, max(highest, *letters), decided)
            self.undo(mark)

    def without(self, level: int, highest: int, chosen: _Chosen) -> Iterator[Solution]:
        """The same, where there is no such part."""
        problem, number = self.problem, self.problem.parts[level]
        refused = chosen.refused | {channel for channel in problem.allowed if number in channel}
        if problem.is_hopeful(chosen.joins, refused):
            yield from self.part(level + 1, highest, chosen._replace(refused=refused))

    def joins(self, channels: list[Channel], n: int, chosen: _Chosen) -> Iterator[_Chosen]:
        """Every way to decide on joins of parts that there are, from the n-th on; fewest first."""
        if n == len(channels):
            yield chosen
            return
        channel, problem = channels[n], self.problem
        dockings = problem.meetings[channel[:2]][channel]
        mark = len(self.trail)
        if channel not in problem.required:
            self.tick()
            refused = chosen.refused | {channel}
            is_hopeful = channel not in problem.allowed or problem.is_hopeful(chosen.joins, refused)
            if is_hopeful and self.shuts(channel, dockings):
                yield from self.joins(channels, n + 1, chosen._replace(refused=refused))
            self.undo(mark)
        if channel in problem.allowed and channel not in chosen.refused:
            self.tick()
            if self.opens(dockings):
                yield from self.joins(channels, n + 1, chosen._replace(joins=chosen.joins | {channel}))
            self.undo(mark)

    def waves(self, part: int, chosen: _Chosen) -> tuple[Wave, ...]:
        """The waves that end in a part, or in the pieces that breaks leave of it."""
        plan = self.problem.plan
        made = [way.waves for join in sorted(chosen.joins) if join.c == part for way in plan.joins[join].values()]
        if self.problem.breaks:
            made += [following for broken, following in plan.breaks.items() if broken.c == part]
        return tuple(wave for waves in made for wave in waves)

    def rests(self, part: int) -> bool:
        """No internal rule acts in the part."""
        return all(
            self.settled(self.followed, self.resting(own, around), self.letters[own])
            for own, around in self.problem.stable[part]
        )

    def opens(self, dockings: Iterable[Docking]) -> bool:
        """A join is open, and that opens none that must not be."""
        for reading in dict.fromkeys(reading for docking in dockings for reading in docking):
            key = self.docked(reading)
            if key in self.joined:
                continue
            if any(other in self.joined or other == key for other in self.excluded.get(key, ())):
                return False
            self.put(self.joined, key, None)
        return True

    def shuts(self, name: object, dockings: Iterable[Docking]) -> bool:
        """None of the meetings is open that must not be; name : of this set of them."""
        if name not in self.known_shut:
            pairs = [pair for pair in dockings if all(shown_of(reading) in self.kinds for reading in pair)]
            places = {reading: n for n, reading in enumerate(dict.fromkeys(r for pair in pairs for r in pair))}
            self.known_shut[name] = list(map(self.terms, places)), [(places[a], places[b]) for a, b in pairs]
        readings, met = self.known_shut[name]
        keys = [self.key(*terms) for terms in readings]
        for first, second in {(keys[i], keys[j]) for i, j in met}:
            if first in self.joined and second in self.joined:
                return False
            for key, other in ((first, second), (second, first)):
                others = self.excluded.setdefault(key, {})
                if other not in others:
                    self.put(others, other, None)
        return True

    def wave(self, waves: tuple[Wave, ...], n: int) -> Iterator[None]:
        """Every way to settle the rules so that the waves from the n-th on come to rest where they should."""
        if n == len(waves):
            yield
            return
        wave = waves[n]
        final = [self.letters[u] for u in self.problem.plan.parts[wave.part].unknowns]
        letters = [self.letters[u] for u in wave.before]
        for written in self.written(wave, 0, letters, final):
            for _ in self.rounds(wave.part, written, final, ()):
                yield from self.wave(waves, n + 1)

    def written(self, wave: Wave, n: int, letters: list[int], final: list[int]) -> Iterator[list[int]]:
        """What the cubes that took part in the event write, from the n-th on."""
        if n == len(wave.writers):
            yield letters
            return
        cube, reading = wave.writers[n]
        if isinstance(reading, Loss):
            table: dict[Key, Any] = self.lost
            key = self.resting(reading.own, reading.around) << BITS | self.letters[reading.lost]
        else:
            table, key = self.joined, self.docked(reading)
        for letter in self.choices(table, key, final[cube], True):
            mark = len(self.trail)
            self.settled(table, key, letter)
            yield from self.written(wave, n + 1, [*letters[:cube], letter, *letters[cube + 1 :]], final)
            self.undo(mark)

    def rounds(self, part: int, letters: list[int], final: list[int], seen: tuple[list[int], ...]) -> Iterator[None]:
        """Rounds of the internal rules, all cubes at once, until the letters are final."""
        self.tick()
        if letters == final:
            yield
            return
        if letters in seen:
            return
        keys = [
            sum([1 << 3 * letters[n] for n in around]) << BITS | letters[cube]
            for cube, around in enumerate(self.around[part])
        ]
        order = sorted(range(len(keys)), key=lambda cube: letters[cube] == final[cube])  # wrong ones choose first
        for following in self.round(order, 0, keys, letters, final, letters):
            if following != letters:
                yield from self.rounds(part, following, final, (*seen, letters))

    def round(
        self, order: list[int], n: int, keys: list[Key], letters: list[int], final: list[int], following: list[int]
    ) -> Iterator[list[int]]:
        """One round, from the n-th cube in order on."""
        if n == len(order):
            yield following
            return
        cube = order[n]
        for letter in self.choices(self.followed, keys[cube], final[cube], False, letters[cube]):
            mark = len(self.trail)
            self.settled(self.followed, keys[cube], letter)
            yield from self.round(
                order, n + 1, keys, letters, final, [*following[:cube], letter, *following[cube + 1 :]]
            )
            self.undo(mark)

    def choices(
        self, table: dict[Key, Any], key: Key, final: int, writes: bool, own: int | None = None
    ) -> Iterable[int]:
        """Letters that a rule may write: what is settled, or the final letter, or to wait, or any."""
        known = table.get(key)
        if known is not None:
            return (known,)
        if self.deferred:
            return dict.fromkeys((final, *(() if own is None else (own,)), *range(self.n_letters)))
        return (final,) if writes or own is None or own == final else (final, own)

    def settled(self, table: dict[Key, Any], key: Key, letter: int) -> bool:
        """Settle what a rule writes; False where something else is settled."""
        known = table.get(key)
        if known is None:
            self.put(table, key, letter)
        return known is None or known == letter

    def put(self, table: dict[Key, Any], key: Key, value: Any) -> None:
        """Write into a table, to be undone."""
        self.trail.append((table, key, table.get(key, _NOTHING)))
        table[key] = value

    def undo(self, mark: int) -> None:
        """Take back what was decided since."""
        while len(self.trail) > mark:
            table, key, before = self.trail.pop()
            if before is _NOTHING:
                del table[key]
            else:
                table[key] = before

    def resting(self, own: int, around: tuple[int, ...]) -> Key:
        """A cube's letter and its neighbours'."""
        letters = self.letters
        return sum([1 << 3 * letters[n] for n in around]) << BITS | letters[own]

    def docked(self, reading: Reading) -> Key:
        """A reading with its letters."""
        return self.key(*self.terms(reading))

    def terms(self, reading: Reading) -> _Terms:
        """What a reading's key is made of."""
        if reading not in self.known_terms:
            kind = self.kinds[shown_of(reading)]
            plain = (
                (reading.own, reading.partner) if reading.across < 0 else (reading.own, reading.partner, reading.across)
            )
            self.known_terms[reading] = kind, plain, reading.around, reading.touched or ()
        return self.known_terms[reading]

    def key(self, kind: int, single: tuple[int, ...], around: tuple[int, ...], touched: tuple[int, ...]) -> Key:
        """A number for a kind of reading, single unknowns, and two multisets of them."""
        letters = self.letters
        key = kind
        for unknown in single:
            key = key << BITS | letters[unknown]
        neighbours = others = 0
        for unknown in around:
            neighbours += 1 << 3 * letters[unknown]
        for unknown in touched:
            others += 1 << 3 * letters[unknown]
        return (key << 3 * MOST_LETTERS | others) << 3 * MOST_LETTERS | neighbours

    def tables(self, chosen: _Chosen) -> Solution:
        """What is settled, with the keys written out in full."""
        waves = [wave for part in chosen.parts for wave in self.waves(part, chosen)]
        joined, lost = {}, {}
        for _, reading in (writer for wave in waves for writer in wave.writers):
            if isinstance(reading, Loss):
                lost[reading] = self.lost[
                    self.resting(reading.own, reading.around) << BITS | self.letters[reading.lost]
                ]
            else:
                joined[reading] = self.joined[self.docked(reading)]
        followed = {}
        for key, letter in self.followed.items():
            own, around = key & (1 << BITS) - 1, key >> BITS
            if letter != own:
                followed[own, tuple(n for n in range(MOST_LETTERS) for _ in range(around >> 3 * n & 7))] = letter
        parts = self.problem.plan.parts
        letters = {u: self.letters[u] for part in chosen.parts for u in parts[part].unknowns}
        return Solution(tuple(sorted(chosen.joins)), chosen.parts, letters, joined, lost, followed)  # type: ignore[arg-type]  # all are settled


def _namings(n: int, highest: int, n_letters: int) -> Iterator[tuple[int, ...]]:
    """Letters for n unknowns, new ones in the order of the alphabet."""
    if n == 0:
        yield ()
        return
    for letter in range(min(highest + 1, n_letters - 1) + 1):
        for rest in _namings(n - 1, max(highest, letter), n_letters):
            yield (letter, *rest)
