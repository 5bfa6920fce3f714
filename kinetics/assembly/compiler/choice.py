"""The choice among books with as many letters: the joins with the largest yield, then the fewest rules."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from kinetics.assembly.compiler.budget import Budget, OutOfStepsError
from kinetics.assembly.compiler.clauses import Clauses
from kinetics.assembly.compiler.joins import JoinSearch
from kinetics.assembly.compiler.plan import Channel
from kinetics.assembly.compiler.proof import book_of
from kinetics.assembly.compiler.search import LetterSearch, OutOfRoundsError, Prefer, Solution, first_letter
from kinetics.assembly.compiler.yields import Yields, yields_with

CHOICE_STEPS = 1_000  # to find sets of joins
COMPARED = 100  # sets whose yields are compared
BEST_SETS = 4  # of these, that are tried with one more join
EARNED = 0.02  # of yield by each join, as its rate has to be measured; the rate equations are hardly better than that
SET_STEPS, SETS_STEPS = 1_000, 12_000  # to find letters for one of these sets, and for all until one has some
VARIATIONS = 12  # other letters for the set that is taken, of which some may take fewer rules

Joins = frozenset[Channel]


@dataclass
class Choice:
    """The books of a search, ordered by the yields of their joins, and what could be better.

    known : solutions with some of the sets
    sets : of joins, the best first: the largest yields, less EARNED for each join
    is_given : whether its joins were asked for, so that there is no choice; is_all : whether the sets are all there are
    excluded, undecided : sets for which no such book exists, and for which none was found in the steps allowed
    """

    search: LetterSearch
    known: dict[Joins, Solution]
    sets: dict[Joins, Yields]
    is_given: bool
    is_all: bool
    excluded: list[Joins] = field(default_factory=list)
    undecided: list[Joins] = field(default_factory=list)

    @classmethod
    def among(cls, search: LetterSearch, found: Solution, joins: Iterable[Channel] | None) -> Choice:
        """The choice among all sets of joins of a search, or no choice, where joins are given."""
        known = {frozenset(found.joins): found}
        if joins is not None:
            return cls(search, known, {own: yields_with(search.plan, own) for own in known}, True, False)
        fewer: Solution | None = found
        while fewer is not None:
            known[frozenset(fewer.joins)] = found = fewer
            fewer = None
            with suppress(OutOfStepsError, OutOfRoundsError), search.clauses.budget.at_most(SET_STEPS):
                fewer = search.fewer_joins(found)
        sets, is_all = _sets_by_yield(search, list(known))
        return cls(search, known, sets, False, is_all)

    def solutions(self) -> Iterator[Solution]:
        """Solutions, the best first."""
        budget = self.search.clauses.budget
        last = budget.steps + budget.times(SETS_STEPS)
        for joins in self.sets:
            made, is_all = self.known.get(joins), False
            if made is None and budget.steps < last:
                made, is_all = tried(self.search, joins, SET_STEPS)
            if made is not None:
                yield from [made] if self.is_given else self._varied(made)
            (self.excluded if is_all else self.undecided).append(joins)

    def gain(self, taken: Solution) -> float | None:
        """How much more the best set yields for which it is undecided whether there is a book; None: no choice."""
        return None if self.is_given else self._more(self.undecided, taken)

    def in_words(self, taken: Solution) -> str:
        """What was compared, and what a longer search or more letters could gain."""
        if self.is_given:
            return "the first book found"
        gain, letters = (self._more(sets, taken) for sets in (self.undecided, self.excluded))
        number = len(self.sets)
        sets = f"all {number} sets of joins" if self.is_all else f"{number} sets of joins, of more that there are"
        longer = f"could gain {gain:.2f} of yield" if gain else "of these sets gains nothing"
        more = f", more letters could gain {letters:.2f}" if letters else ""
        return (
            f"the best yield, less {EARNED:g} for each join, of {sets} (a longer search {longer}{more}); "
            f"the fewest rules of {VARIATIONS + 1} books with these joins"
        )

    def _more(self, sets: list[Joins], taken: Solution) -> float:
        own = self.sets[frozenset(taken.joins)].mean
        return round(max([0.0, *(self.sets[joins].mean - own for joins in sets)]), 2)

    def _varied(self, found: Solution) -> list[Solution]:
        """The solution and others with its joins, the fewest rules first."""
        rng = np.random.default_rng(0)  # fixed, so that a target always gives the same book

        def drawn(n_cells: int, n_letters: int) -> np.ndarray:
            return rng.integers(-1, n_letters, n_cells) * (rng.random(n_cells) < rng.random())

        made = [tried(self.search, found.joins, SET_STEPS, drawn)[0] for _ in range(VARIATIONS)]
        return sorted([found, *filter(None, made)], key=self._size)

    def _size(self, solution: Solution) -> int:
        return len(book_of(self.search.plan, solution).all_rules)


def tried(
    search: LetterSearch, joins: Iterable[Channel] | None, steps: int, prefer: Prefer = first_letter
) -> tuple[Solution | None, bool]:
    """A solution, and whether all were tried."""
    try:
        with search.clauses.budget.at_most(steps):
            found = search.find(joins, prefer)
    except (OutOfStepsError, OutOfRoundsError):
        return None, False
    return found, found is None


def _sets_by_yield(search: LetterSearch, known: list[Joins]) -> tuple[dict[Joins, Yields], bool]:
    """Sets of joins by their yields, and whether they are all.

    All, where they are few. Otherwise those that are known to have a book; those from which no join can be left out, as
    far as they are found, the ones of the fewest joins; and the best of these with one more join, while that helps.
    """
    plan, budget = search.plan, search.clauses.budget
    most = budget.times(COMPARED)

    def begun() -> JoinSearch:
        return JoinSearch(plan, search.allowed, Clauses(1, budget))

    first, is_all = _listed(islice(begun().every(), most + 1), budget)
    is_all = is_all and len(first) <= most
    if not is_all:
        smallest, _ = _listed(begun().smallest(), budget)
        first = [*known, *sorted(smallest, key=lambda joins: (len(joins), sorted(joins)))[: most // 2]]
    sets: dict[Joins, Yields] = {}
    for joins in first:
        budget.check()
        sets[joins] = yields_with(plan, joins)
    whole, extended = begun(), set[Joins]()
    with suppress(OutOfStepsError), budget.at_most(CHOICE_STEPS):
        while fresh := [] if is_all else [joins for joins in _in_order(sets)[:BEST_SETS] if joins not in extended]:
            extended.update(fresh)
            for more in [joins | {join} for joins in fresh for join in whole.open if join not in joins]:
                given = [*whole.only(more), *(whole.open[join] for join in more)]
                if len(sets) < most and more not in sets and whole.holds(given):
                    sets[more] = yields_with(plan, more)
    return {joins: sets[joins] for joins in _in_order(sets)}, is_all


def _listed(sets: Iterator[Joins], budget: Budget) -> tuple[list[Joins], bool]:
    """Those that are found in the steps allowed, and whether they came to an end."""
    found: list[Joins] = []
    try:
        with budget.at_most(CHOICE_STEPS):
            found.extend(sets)
    except OutOfStepsError:
        return found, False
    return found, True


def _in_order(sets: dict[Joins, Yields]) -> list[Joins]:
    """The best first: the largest yields, less what each join has to earn."""
    return sorted(sets, key=lambda joins: (round(EARNED * len(joins) - sets[joins].mean, 4), sorted(joins)))
