"""The book with the fewest letters of a plan, then with the largest yield, then with the fewest rules."""

from __future__ import annotations

from collections.abc import Iterable

from kinetics.assembly.compiler import reasons
from kinetics.assembly.compiler.budget import Budget
from kinetics.assembly.compiler.choice import Choice, tried
from kinetics.assembly.compiler.joins import sensible
from kinetics.assembly.compiler.plan import Channel, Plan
from kinetics.assembly.compiler.proof import NotProvenError, proven
from kinetics.assembly.compiler.result import Certificate, Compiled, Notify, Ruled, RuledOut, sensing
from kinetics.assembly.compiler.search import LetterSearch

MAX_LETTERS = 8  # where the target names no other number
STEPS = 4_000  # of the first search with each number of letters
MOST_UNDECIDED = 2  # numbers of letters, after which more are not tried

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
    most, sets = target.max_letters or MAX_LETTERS, "any joins" if joins is None else "these joins"
    for n in range(1, most + 1):
        report(f"{sensing(plan.senses)}: {n} letters")
        before = budget.steps
        search = LetterSearch(plan, allowed, n, budget)
        found, is_all = tried(search, joins, steps)
        if found is None and is_all:
            exhausted.append(RuledOut(n, budget.steps - before))
            continue
        if found is not None:
            choice = Choice.among(search, found, None if joins is None else frozenset(joins))
            for solution in choice.solutions():
                try:
                    book, verified = proven(plan, solution, budget.check)
                except NotProvenError as error:
                    report(str(error))
                    continue
                searched = [
                    f"{_letters(m)}, {sets}: none does, all were tried ({steps} steps)" for m, steps in exhausted
                ]
                searched += [f"{_letters(m)}, {sets}: not decided in the steps allowed" for m in undecided]
                searched.append(f"{_letters(n)}, {sets}: {choice.in_words(solution)}")
                names, is_fewest = tuple(map(plan.name, solution.joins)), not undecided
                claims = Certificate(
                    target.name, book.fingerprint, n, is_fewest, joins is None, names, tuple(exhausted), ()
                )
                found_yields, gain = choice.sets[frozenset(solution.joins)], choice.gain(solution)
                return Compiled(book, is_fewest, names, (KIND, *searched), verified, claims, found_yields, gain)
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


def _letters(number: int) -> str:
    return f"{number} letter{'' if number == 1 else 's'}"


def _numbers(numbers: Iterable[int]) -> str:
    """`2, 3 or 4`."""
    *first, last = map(str, numbers)
    return f"{', '.join(first)} or {last}" if first else last
