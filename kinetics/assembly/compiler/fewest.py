"""The book with the fewest letters of a plan, then with the fewest rules, then with the largest yield."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import islice

import numpy as np

from kinetics.assembly.compiler import reasons
from kinetics.assembly.compiler.budget import Budget, OutOfStepsError
from kinetics.assembly.compiler.clauses import Clauses
from kinetics.assembly.compiler.joins import JoinSearch, sensible
from kinetics.assembly.compiler.plan import Channel, Plan
from kinetics.assembly.compiler.proof import NotProvenError, book_of, proven
from kinetics.assembly.compiler.result import Certificate, Compiled, Notify, Ruled, RuledOut, sensing
from kinetics.assembly.compiler.search import LetterSearch, OutOfRoundsError, Prefer, Solution, first_letter
from kinetics.assembly.deriving.derive import derive
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.support.packages import integrate

MAX_LETTERS = 8  # where the target names no other number
STEPS = 4_000  # of the first search with each number of letters
SET_STEPS = 1_000  # where one set of joins is tried of many
CHOICE_STEPS = 1_000  # to find these sets
MOST_UNDECIDED = 2  # numbers of letters, after which more are not tried
SETS = 24  # of joins, of which each may give a book with fewer rules
BEST_SETS, VARIATIONS = 4, 12  # of those with the fewest rules, and other solutions for each
# What yields are compared by: free cubes at first, time in tu, and rates in 1/tu of a pair of faces and of a bond.
CUBES, DURATION, JOIN, BREAK = 60, 2000.0, 7e-5, 3e-5


KIND = (
    "kind of books: both cubes need a rule to bond, and both read before either writes; all structures of one shape "
    "have the same letters, and so have places that symmetry exchanges; a join happens in all its ways or not at "
    "all; cubes oriented as in the book's target"
)


def fewest(
    plan: Plan,
    joins: Iterable[Channel] | None,
    budget: Budget,
    report: Notify,
    steps: int = STEPS,
) -> Compiled | Ruled:
    """The best book for some joins; None: over all sets of joins. Else why there is none, or none was found.

    steps : of the first search with each number of letters
    """
    target = plan.target
    told_apart = (join for join in plan.joins if all(clash.made for clash in reasons.clashes(plan, [join])))
    allowed = sensible(plan, told_apart if joins is None else joins)
    exhausted: list[RuledOut] = []
    undecided: list[int] = []
    most = target.max_letters or MAX_LETTERS
    for n in range(1, most + 1):
        report(f"{sensing(plan.senses)}: {n} letters")
        before = budget.steps
        search = LetterSearch(plan, allowed, n, budget)
        found, is_all = _tried(search, joins, steps)
        if found is None and is_all:
            exhausted.append(RuledOut(n, budget.steps - before))
            continue
        several = _some_sets(plan, allowed, budget) if joins is None else []
        compared = [] if found is None else _varied(search, found, several)
        for solution in _in_order(plan, compared):
            try:
                book, verified = proven(plan, solution, budget.check)
            except NotProvenError as error:
                report(str(error))
                continue
            names, few = tuple(map(plan.name, solution.joins)), tuple(exhausted)
            sets = "any joins" if joins is None else "these joins"
            searched = [f"{_letters(m)}, {sets}: none does, all were tried ({steps} steps)" for m, steps in few]
            searched += [f"{_letters(m)}, {sets}: not decided in the steps allowed" for m in undecided]
            how = (
                f"of {len(compared)} books the one with the fewest rules, then the largest yield: the first found with "
                f"any joins, and with each of {len(several)} sets of joins; not all books were compared"
                if joins is None
                else "the first book found"
            )
            searched.append(f"{_letters(n)}{'' if joins is None else ', these joins'}: {how}")
            is_fewest = not undecided
            claims = Certificate(target.name, book.fingerprint, n, is_fewest, joins is None, names, few, ())
            return Compiled(book, is_fewest, names, (KIND, *searched), verified, claims)
        undecided.append(n)
        if len(undecided) == MOST_UNDECIDED:
            break
    asked = "" if joins is None else f"the joins {reasons.choice(plan, joins)}: "
    head = f"target {target.name!r}"
    if undecided:
        text = (
            f"{head} with {sensing(plan.senses)}: not decided: {asked}no book found with {_numbers(undecided)} letters "
            "in the steps allowed"
        )
    else:
        text = (
            f"{head} is infeasible with this sensing ({sensing(plan.senses)}) because {asked}it takes more than {most} "
            "letters: all were tried"
        )
    return Ruled(plan.senses, text, not undecided, (reasons.situations(plan, ()),), tuple(exhausted))


def _some_sets(plan: Plan, allowed: Iterable[Channel], budget: Budget) -> list[frozenset[Channel]]:
    """Sets of joins from which none can be left out; of those that are found first, the ones of the fewest joins. Where
    these are few, others as well.
    """

    def search() -> JoinSearch:
        return JoinSearch(plan, allowed, Clauses(1, budget))

    found: list[frozenset[Channel]] = []
    with suppress(OutOfStepsError), budget.at_most(CHOICE_STEPS):
        found.extend(search().smallest())
    found = sorted(found, key=lambda joins: (len(joins), sorted(joins)))[:SETS]
    with suppress(OutOfStepsError), budget.at_most(CHOICE_STEPS):
        found.extend(islice((joins for joins in search().every() if joins not in found), SETS - len(found)))
    return found


def _tried(
    search: LetterSearch, joins: Iterable[Channel] | None, steps: int, prefer: Prefer = first_letter
) -> tuple[Solution | None, bool]:
    """A solution, and whether all were tried."""
    try:
        with search.clauses.budget.at_most(steps):
            found = search.find(joins, prefer)
    except (OutOfStepsError, OutOfRoundsError):
        return None, False
    return found, found is None


def _varied(search: LetterSearch, found: Solution, several: list[frozenset[Channel]]) -> list[Solution]:
    """Solutions with as many letters: with sets of joins, with fewer joins, and others for those with few rules."""
    compared = [found]

    def no_letter(n_cells: int, _: int) -> np.ndarray:
        return np.full(n_cells, -1)

    rng = np.random.default_rng(0)  # fixed, so that a target always gives the same book

    def drawn(n_cells: int, n_letters: int) -> np.ndarray:
        return rng.integers(-1, n_letters, n_cells) * (rng.random(n_cells) < rng.random())

    fewer: Solution | None = found if several else None
    while fewer is not None:
        found, fewer = fewer, None
        with suppress(OutOfStepsError, OutOfRoundsError), search.clauses.budget.at_most(SET_STEPS):
            fewer = search.fewer_joins(found)
            compared += [] if fewer is None else [fewer]
    for joins in several:
        for prefer in (first_letter, no_letter):
            made, _ = _tried(search, joins, SET_STEPS, prefer)
            if made is None:
                break
            compared.append(made)
    compared.sort(key=lambda solution: _size(search, solution))
    for best in list(dict.fromkeys(solution.joins for solution in compared))[:BEST_SETS]:
        for _ in range(VARIATIONS):
            made, _ = _tried(search, best, SET_STEPS, drawn)
            compared += [] if made is None else [made]
    return compared


def _size(search: LetterSearch, found: Solution) -> int:
    return len(book_of(search.plan, found).all_rules)


def _in_order(plan: Plan, found: list[Solution]) -> Iterator[Solution]:
    """The solutions, fewest rules first; of as many, the largest yields first."""
    books = [book_of(plan, solution) for solution in found]
    counts = [len(book.all_rules) for book in books]
    for count in sorted(set(counts)):
        alike = [n for n, own in enumerate(counts) if own == count]
        if len(alike) > 1:
            yields = {n: target_yield(books[n]) for n in alike}
            alike.sort(key=lambda n: -yields[n])
        yield from (found[n] for n in alike)


def target_yield(book: RuleBook) -> float:
    """The share of CUBES free cubes that are in targets after DURATION, by the rate equations of the derived network.

    Every pair of faces that may join does so at the rate JOIN, every bond breaks at BREAK. Rounded to .001, as it only
    decides between books with as many letters and rules.
    """
    derived = derive(book)
    sizes = np.array([len(structure) for structure in derived.structures.values()])
    before, change, rates = [], np.zeros((len(derived.events), sizes.size)), []
    for row, (event, ways) in enumerate(derived.events.items()):
        for side, sign in ((event.before, -1), (event.after, 1)):
            np.add.at(change[row], list(side), sign)
        before.append([*event.before, -1][:2])
        like = 0.5 if len(set(event.before)) < len(event.before) else 1.0
        rates.append(sum(ways.values()) * (JOIN * like if len(event.before) == 2 else BREAK))
    first, second = np.array(before).T
    start = np.where(np.arange(sizes.size) == 0, float(CUBES), 0.0)
    done = integrate.solve_ivp(
        lambda _, y: (np.array(rates) * y[first] * np.where(second < 0, 1.0, y[second])) @ change,
        (0.0, DURATION),
        start,
        method="LSODA",
        rtol=1e-6,
        atol=1e-6,
    )
    assert book.target is not None  # noqa: S101  the compiler's books have one
    target = derived.species_of(book.target)
    return round(float(done.y[target, -1] * sizes[target] / CUBES), 3)


def _letters(number: int) -> str:
    return f"{number} letter{'' if number == 1 else 's'}"


def _numbers(numbers: Iterable[int]) -> str:
    """`2, 3 or 4`."""
    *first, last = map(str, numbers)
    return f"{', '.join(first)} or {last}" if first else last
