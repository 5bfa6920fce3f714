"""Clauses over letters: constraints on cells with one letter each, and the solver for these letters.

A literal is an even number, or that number and 1, its denial. Literals for `two cells have the same letter` and `two
sets of cells have the same letters, each as often` are made when they are first asked for.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import product

import numpy as np

from kinetics import kernels
from kinetics.assembly.compiler.budget import Budget

AT_ONCE = 1000  # conflicts, between looks at the clock
KEPT = 4000  # learned clauses; of more, the longer half is forgotten


class Clauses:
    """Clauses, and values for which all of them hold.

    n_letters : of each cell
    letters : of the cells, after `solve` (n_cells,); true : of the literals
    """

    def __init__(self, n_letters: int, budget: Budget):
        self.n_letters, self.budget = n_letters, budget
        self.n_literals, self.n_clauses = 0, 0
        self.literals, self.starts = np.zeros(1 << 16, np.int64), np.zeros(1 << 14, np.int64)
        self.learned = np.zeros(self.starts.size, np.bool_)
        self.activity, self.phase = np.zeros(0), np.zeros(0, np.bool_)
        self.true = np.zeros(0, np.bool_)
        self.cells: list[int] = []  # the literal of each cell's first letter; those of the others follow
        self.pending: list[list[int]] = []
        self._same: dict[tuple[tuple[int, ...], tuple[int, ...]], int] = {}
        self._counted: dict[tuple[int, ...], dict[tuple[int, ...], int]] = {}
        self.impossible = False

    @property
    def letters(self) -> np.ndarray:
        """The letter of each cell."""
        first = np.array(self.cells, np.int64)
        return np.asarray(self.true[first[:, None] + 2 * np.arange(self.n_letters)].argmax(axis=1))

    def literal(self) -> int:
        """A new one."""
        self.n_literals += 2
        return self.n_literals - 2

    def cell(self) -> int:
        """A new cell."""
        first = [self.literal() for _ in range(self.n_letters)]
        self.add(*first)
        for n, one in enumerate(first):
            for other in first[:n]:
                self.add(one ^ 1, other ^ 1)
        self.cells.append(first[0])
        return len(self.cells) - 1

    def has(self, cell: int, letter: int) -> int:
        """The literal of a cell with a letter."""
        return self.cells[cell] + 2 * letter

    def add(self, *clause: int) -> None:
        """One of these literals must be true."""
        self.pending.append(list(dict.fromkeys(clause)))

    def same(self, one: int, other: int) -> int:
        """Whether two different cells have the same letter."""
        key = (min(one, other),), (max(one, other),)
        if key not in self._same:
            self._same[key] = same = self.literal()
            for letter in range(self.n_letters):
                has = self.has(one, letter), self.has(other, letter)
                for a, b, c in ((*has, same), (has[0], same, has[1]), (has[1], same, has[0])):
                    self.add(a ^ 1, b ^ 1, c)
        return self._same[key]

    def unlike(self, pairs: Iterable[tuple[Iterable[int], Iterable[int]]]) -> list[int]:
        """Literals of which one is true unless in each pair, of as many cells, both have the same letters."""
        found = []
        for some, others in pairs:
            one, two = Counter(some), Counter(others)
            left = tuple(sorted((one - two).elements())), tuple(sorted((two - one).elements()))
            if len(left[0]) == 1:
                found.append(self.same(left[0][0], left[1][0]) ^ 1)
            elif left[0]:
                found.append(self._alike(*sorted(left)) ^ 1)
        return found

    def _alike(self, one: tuple[int, ...], other: tuple[int, ...]) -> int:
        """True if cells have the same letters as others, in any order; else as it may be."""
        if (one, other) not in self._same:
            self._same[one, other] = alike = self.literal()
            first, second = self._count(one), self._count(other)
            for letters, literal in first.items():
                self.add(literal ^ 1, second[letters] ^ 1, alike)
        return self._same[one, other]

    def _count(self, cells: tuple[int, ...]) -> dict[tuple[int, ...], int]:
        """For all letters that some cells can have, sorted, a literal that is true where they do."""
        if cells not in self._counted:
            found = self._counted[cells] = {}
            for letters in product(range(self.n_letters), repeat=len(cells)):
                key = tuple(sorted(letters))
                if key not in found:
                    found[key] = self.literal()
                self.add(*(self.has(c, letter) ^ 1 for c, letter in zip(cells, letters, strict=True)), found[key])
        return self._counted[cells]

    def prefer(self, letters: np.ndarray, first: list[int]) -> None:
        """Look for cells with these letters (n_cells,), whatever was found before; -1: for none; and before that, for
        values with which the literals `first` are true.
        """
        self._write()
        self.phase[:] = False
        chosen = letters >= 0
        self.phase[np.array(self.cells, np.int64)[chosen] // 2 + letters[chosen]] = True
        wanted = np.array(first, np.int64) // 2
        self.phase[wanted] = True
        self.activity[wanted] += self.activity.max(initial=0.0) + 1.0

    def solve(self, assumed: Iterable[int] = ()) -> bool:
        """Whether there are values for which all clauses hold and the assumed literals are true.

        Every conflict is a step of the budget, and so is the call.
        """
        self.budget.step()
        self._write()
        given = np.array(list(assumed), np.int64)
        values = np.zeros(self.n_literals, np.int8)
        while not self.impossible:
            before = self.n_clauses
            status, self.n_clauses, conflicts = kernels.clauses.solve(
                self.literals, self.starts, before, given, self.activity, self.phase, values, AT_ONCE
            )
            self.learned[before : self.n_clauses] = True
            self.budget.step(conflicts)
            if status == kernels.clauses.UNSATISFIABLE:
                return False
            if status == kernels.clauses.SATISFIABLE:
                self.true = values == 1
                return True
            self._forget()
        return False

    def _write(self) -> None:
        """Write the added clauses to the solver's arrays, with room for learned ones."""
        lengths = [len(clause) for clause in self.pending]
        self.impossible |= 0 in lengths
        variables = self.n_literals // 2
        more = variables - self.activity.size
        self.activity, self.phase = np.pad(self.activity, (0, more)), np.pad(self.phase, (0, more))
        used = self.starts[self.n_clauses]
        self._grow(used + 2 * sum(lengths) + 16 * variables, self.n_clauses + len(lengths) + 4 * AT_ONCE)
        flat = [literal for clause in self.pending for literal in clause]
        self.literals[used : used + len(flat)] = flat
        last = self.n_clauses + len(lengths)
        self.starts[self.n_clauses + 1 : last + 1] = used + np.cumsum(lengths, dtype=np.int64)
        self.learned[self.n_clauses : last] = False
        self.n_clauses = last
        self.pending = []

    def _grow(self, literals: int, clauses: int) -> None:
        """Room for so many."""
        if literals > self.literals.size:
            self.literals = np.pad(self.literals, (0, literals))
        if clauses + 2 > self.starts.size:
            self.starts = np.pad(self.starts, (0, clauses + 2))
            self.learned = np.pad(self.learned, (0, clauses + 2))

    def _forget(self) -> None:
        """Drop the longer half of the learned clauses if there are many."""
        lengths = np.diff(self.starts[: self.n_clauses + 1])
        learned = self.learned[: self.n_clauses]
        if learned.sum() > KEPT:
            kept = ~learned | (lengths <= max(2, np.median(lengths[learned])))
            literals = self.literals[: self.starts[self.n_clauses]][np.repeat(kept, lengths)]
            self.literals[: literals.size] = literals
            self.n_clauses = int(kept.sum())
            self.learned[: self.n_clauses] = learned[kept]
            self.starts[1 : self.n_clauses + 1] = np.cumsum(lengths[kept])
        self._grow(2 * self.starts[self.n_clauses] + 16 * self.activity.size, self.n_clauses + 4 * AT_ONCE)
