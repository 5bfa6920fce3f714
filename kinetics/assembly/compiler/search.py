"""The search for letters: one for each unknown of a plan, and three tables of rules, by clauses.

What is sought:
- the joins that are open have rules for both cubes, and no other meeting of two parts has;
- after every join and every break, internal rules lead to the letters of what was made, and none acts in it then.
Each part has one set of letters, and a free cube's may stand in larger parts, if its neighbours tell it apart.
A clause says of what is read that, letters being the same, so is the rule. There are too many such pairs, so those are
written down that letters found before have broken, until letters break none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinetics.assembly.compiler.budget import Budget
from kinetics.assembly.compiler.clauses import Clauses
from kinetics.assembly.compiler.dockings import Reading
from kinetics.assembly.compiler.joins import JoinSearch
from kinetics.assembly.compiler.plan import Channel, Loss, Plan, Wave
from kinetics.assembly.faces import IntArray

MOST_LETTERS = 15
MOST_ROUNDS = 8  # of internal rules after one event
MOST_BROKEN = 200  # clauses of one kind written down at once
SIDES = 6


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


class _Step(NamedTuple):
    """A cube in one round of the internal rules.

    active : literal of there being such a cube
    own, near : cells of its letter and its neighbours'; after : that of its letter in the next round
    """

    active: int
    own: int
    near: tuple[int, ...]
    after: int


class _Running(NamedTuple):
    """A wave, with the cells of its letters in each round; those of the end, and literals of having got there."""

    active: int
    wave: Wave
    rounds: list[list[int]]
    final: list[int]
    over: list[int]


Prefer = Callable[[int, int], np.ndarray]


def first_letter(n_cells: int, _: int) -> np.ndarray:
    """The letter of a free cube for all cells."""
    return np.zeros(n_cells, np.int64)


class LetterSearch(JoinSearch):
    """Letters for a plan, no more than so many.

    allowed : joins that a book may have
    `find` may be called again and again; what was learned before is kept.
    """

    def __init__(self, plan: Plan, allowed: Iterable[Channel], n_letters: int, budget: Budget):
        if not 1 <= n_letters <= MOST_LETTERS:
            raise ValueError(f"{n_letters} letters; the search takes 1 to {MOST_LETTERS}")
        super().__init__(plan, allowed, clauses := Clauses(n_letters, budget))
        unknowns = sorted({u for part in self.parts for u in plan.parts[part].unknowns})
        self.cells = {unknown: clauses.cell() for unknown in unknowns}
        clauses.add(clauses.has(0, 0))
        for n, cell in enumerate(self.cells.values()):  # new letters in the order of the alphabet
            for letter in range(1, n_letters):
                clauses.add(clauses.has(cell, letter) ^ 1, *(clauses.has(c, letter - 1) for c in range(n)))
        self.results: dict[Reading | Loss, int] = {}  # cells of what cubes write that join or lose a bond
        self.losses: list[tuple[int, Loss]] = []
        self.rounds: list[_Step] = []
        self.waves: list[_Running] = []
        self.settled: list[int] = []  # for each number of rounds, true where these are enough
        self.met: dict[tuple[int, int], IntArray] = {}  # how parts meet (see `_meet`)
        self.read: dict[Reading, int] = {}  # all that cubes read as they meet, numbered
        self.known: list[Reading] = []  # the same in order
        self.table = np.zeros(
            (0, 4 + 2 * SIDES), np.int64
        )  # of these: the kind, and cells of what is read, -1 for none
        self._start()

    def _start(self) -> None:
        plan, present = self.plan, self.present
        for part in self.parts:
            structure, cells = plan.parts[part].structure, [self.cells[u] for u in plan.parts[part].unknowns]
            rests = {(own, tuple(sorted(cells[n] for n in structure.neighbours(c)))) for c, own in enumerate(cells)}
            self.rounds += [_Step(present[part], own, near, own) for own, near in sorted(rests)]
        for join, is_open in self.open.items():
            for way in plan.joins[join].values():
                for wave in way.waves:
                    self._enter(is_open, wave)
        for broken, waves in plan.breaks.items():
            if broken.c in present:
                for wave in waves:
                    self._enter(present[broken.c], wave)
        self._close()

    def _enter(self, active: int, wave: Wave) -> None:
        """A wave, with the letters that the cubes write with which it begins."""
        cells = [self.cells[unknown] for unknown in wave.before]
        for cube, reading in wave.writers:
            if reading not in self.results:
                self.results[reading] = self.clauses.cell()
            cells[cube] = self.results[reading]
            if isinstance(reading, Loss):
                self.losses.append((active, reading))
        final = [self.cells[unknown] for unknown in self.plan.parts[wave.part].unknowns]
        self.waves.append(_Running(active, wave, [cells], final, []))

    def _close(self) -> None:
        """A literal for all waves being over."""
        settled = self.clauses.literal()
        for active, _, rounds, final, over in self.waves:
            over.append(self.clauses.literal())
            self.clauses.add(settled ^ 1, active ^ 1, over[-1])
            for cell, end in zip(rounds[-1], final, strict=True):
                for letter in range(self.clauses.n_letters) if cell != end else ():
                    has = self.clauses.has(cell, letter), self.clauses.has(end, letter)
                    self.clauses.add(over[-1] ^ 1, has[0] ^ 1, has[1])
        self.settled.append(settled)

    def _continue(self) -> None:
        """Another round of every wave."""
        for active, wave, rounds, _, _ in self.waves:
            cells, after = rounds[-1], [self.clauses.cell() for _ in rounds[-1]]
            structure = self.plan.parts[wave.part].structure
            for cube, own in enumerate(cells):
                near = tuple(sorted(cells[n] for n in structure.neighbours(cube)))
                self.rounds.append(_Step(active, own, near, after[cube]))
            rounds.append(after)
        self._close()

    def find(self, joins: Iterable[Channel] | None = None, prefer: Prefer = first_letter) -> Solution | None:
        """A solution with these joins and no others; None: there is none. Joins: None for any.

        prefer : the letters that are looked for first, from the number of cells and of letters; -1 for no letter.
            Others may lead to another solution
        Waves take as few rounds as will do. OutOfRoundsError: all that there is takes more than MOST_ROUNDS.
        """
        given = [] if joins is None else self.only(joins) + [self.open[join] for join in joins]
        letters = prefer(len(self.clauses.cells), self.clauses.n_letters)
        # Few waves take few rules, as a rule.
        self.clauses.prefer(letters, [wave.over[0] for wave in self.waves] if (letters >= 0).any() else [])
        return self._first(given)

    def _first(self, given: list[int]) -> Solution | None:
        for n in range(MOST_ROUNDS + 1):
            if n == len(self.settled):
                self._continue()
            if not self.holds(given):  # not even if waves went on for ever
                return None
            if self.holds([*given, self.settled[n]]):
                return self._solution()
        raise OutOfRoundsError

    def fewer_joins(self, found: Solution) -> Solution | None:
        """A solution with some of the joins of another one; None: there is none."""
        return self._first(self.within(found.joins))

    def is_broken(self) -> bool:
        """Whether what was found breaks a clause that was not written down yet; it is now."""
        if super().is_broken():
            return True
        letters = self.clauses.letters
        return self._misled(letters) | self._ambiguous(letters) | self._circling(letters)

    def _misled(self, letters: np.ndarray) -> bool:
        """Meetings in which both cubes read what cubes read in joins that are open, and must not."""
        is_there = np.zeros(len(self.plan.parts), np.bool_)
        is_there[[part for part, literal in self.present.items() if self.clauses.true[literal]]] = True
        there = np.flatnonzero(is_there).tolist()
        for pair in [(a, b) for a in there for b in there if b <= a and (a, b) not in self.met]:
            self.met[pair] = self._meet(*pair)
        keys, others = self._keys(letters)
        open_: dict[tuple[int, int], int] = {}
        for join in sorted(self.chosen):
            for reading in (reading for docking in self.plan.joins[join] for reading in docking):
                n = self.read[reading]
                open_.setdefault((keys[n], others[n]), n)
        alike = np.array([open_.get(pair, -1) for pair in zip(keys, others, strict=True)])
        literals = list(self.open.values())
        is_open = np.append(self.clauses.true[literals], False)  # the last is no join
        a, b, made, first, second = np.concatenate(list(self.met.values())).T
        wrong = is_there[a] & is_there[b] & ~is_open[made] & (alike[first] >= 0) & (alike[second] >= 0)
        for row in np.flatnonzero(wrong)[:MOST_BROKEN].tolist():
            clause = [self.present[int(a[row])] ^ 1, self.present[int(b[row])] ^ 1]
            if made[row] >= 0:
                clause.append(literals[made[row]])
            for n in (int(first[row]), int(second[row])):
                reading = self.known[alike[n]]
                clause += [
                    self.readings[reading] ^ 1,
                    *self.clauses.unlike(zip(self._terms(self.known[n]), self._terms(reading), strict=True)),
                ]
            self.clauses.add(*clause)
        return bool(wrong.any())

    def _meet(self, a: int, b: int) -> IntArray:
        """How two parts can meet: rows of them, the join that is made or -1, and the two readings."""
        plan, numbers = self.plan, {join: number for number, join in enumerate(self.open)}
        ways = [
            (numbers.get(join, -1), docking)
            for join, dockings in plan.joins.items()
            if join[:2] == (a, b)
            for docking in dockings
        ]
        rows = []
        for made, docking in [*ways, *((-1, docking) for docking in plan.foreign(a, b))]:
            for reading in docking:
                if reading not in self.read:
                    self.read[reading] = len(self.known)
                    self.known.append(reading)
            rows.append((a, b, made, self.read[docking[0]], self.read[docking[1]]))
        return np.array(rows, np.int64).reshape(-1, 5)

    def _keys(self, letters: np.ndarray) -> tuple[list[int], list[int]]:
        """What the readings met so far come to: pairs of numbers that are the same if all that is read is."""
        fresh = []
        for r in self.known[len(self.table) :]:
            some = [[self.cells[u] for u in unknowns] for unknowns in (r.around, r.touched or ())]
            near, touched = (cells + [-1] * (SIDES - len(cells)) for cells in some)
            across = -1 if r.across < 0 else self.cells[r.across]
            fresh.append([self.plan.kinds[r.kind], self.cells[r.own], self.cells[r.partner], across, *near, *touched])
        self.table = np.concatenate([self.table, np.array(fresh, np.int64).reshape(-1, 4 + 2 * SIDES)])
        powers = np.append((SIDES + 1) ** letters, 0)
        letters = np.append(letters, -1)
        keys = self.table[:, 0]
        for cells in self.table.T[1:4]:
            keys = keys * (MOST_LETTERS + 1) + letters[cells] + 1
        near, touched = (powers[cells].sum(axis=1) for cells in np.split(self.table[:, 4:], 2, axis=1))
        return (keys * (SIDES + 1) ** MOST_LETTERS + near).tolist(), touched.tolist()

    def _terms(self, r: Reading) -> list[tuple[int, ...]]:
        """Cells of the letters that are read, those together whose order does not matter."""
        across = (r.across,) if r.across >= 0 else ()
        return [
            tuple(self.cells[u] for u in some) for some in ((r.own,), (r.partner,), r.around, r.touched or (), across)
        ]

    def _ambiguous(self, letters: np.ndarray) -> bool:
        """Cubes that read the same and would have to become different ones."""
        rules: dict[tuple[object, ...], tuple[int, list[tuple[int, ...]], int]] = {}
        value, broken, chosen = letters.tolist(), 0, self.chosen
        uses: list[tuple[int, str, tuple[object, ...], list[tuple[int, ...]], int]] = []
        read = (r for join in sorted(chosen) for docking in self.plan.joins[join] for r in docking)
        uses += [(self.readings[r], "join", r.kind, self._terms(r), self.results[r]) for r in read]
        for active, loss in self.losses:
            terms = [(self.cells[loss.own],), (self.cells[loss.lost],), tuple(self.cells[u] for u in loss.around)]
            uses.append((active, "lose", (), terms, self.results[loss]))
        uses += [(active, "follow", (), [(own,), near], after) for active, own, near, after in self.rounds]
        for active, event, kind, terms, after in uses:
            if not self.clauses.true[active]:
                continue
            key = (event, kind, *(tuple(sorted([value[cell] for cell in some])) for some in terms))
            known = rules.setdefault(key, (active, terms, after))
            if value[known[2]] != value[after]:
                unlike = self.clauses.unlike(zip(known[1], terms, strict=True))
                self.clauses.add(known[0] ^ 1, active ^ 1, *unlike, self.clauses.same(known[2], after))
                broken += 1
                if broken == MOST_BROKEN:
                    break
        return broken > 0

    def _circling(self, letters: np.ndarray) -> bool:
        """Waves that come back to letters that they had before, and so for ever."""
        value, is_any = letters.tolist(), False
        for active, _, rounds, final, over in self.waves:
            if not self.clauses.true[active]:
                continue
            end = [value[cell] for cell in final]
            seen: dict[tuple[int, ...], int] = {}
            for n, cells in enumerate(rounds):
                now = tuple([value[cell] for cell in cells])
                before = seen.setdefault(now, n)
                if before < n and now != tuple(end):
                    unlike = self.clauses.unlike(((a,), (b,)) for a, b in zip(rounds[before], cells, strict=True))
                    self.clauses.add(active ^ 1, over[before], *unlike)
                    is_any = True
                    break
        return is_any

    def _solution(self) -> Solution:
        """What was found."""
        value, true = self.clauses.letters.tolist(), self.clauses.true
        joins = sorted(self.chosen)
        parts = tuple(part for part, literal in self.present.items() if true[literal])
        followed = {
            (value[own], tuple(sorted(value[cell] for cell in near))): value[after]
            for active, own, near, after in self.rounds
            if true[active] and value[own] != value[after]
        }
        return Solution(
            tuple(joins),
            parts,
            {u: value[self.cells[u]] for part in parts for u in self.plan.parts[part].unknowns},
            {r: value[self.results[r]] for join in joins for docking in self.plan.joins[join] for r in docking},
            {loss: value[self.results[loss]] for active, loss in self.losses if true[active]},
            followed,
        )


class OutOfRoundsError(Exception):
    """Nothing was found whose waves are over after so many rounds."""
