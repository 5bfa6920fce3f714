"""The verification of seeded rule books: that they make their target and nothing else.

The checker explores all that a book does if that is affordable, and random growths are tried.
"""

from __future__ import annotations

from collections.abc import Callable

from kinetics.assembly.checking.checker import report_of
from kinetics.assembly.checking.exploration_index import ExplorationIndex
from kinetics.assembly.compiler.budget import Budget
from kinetics.assembly.compiler.result import Notify
from kinetics.assembly.deriving.explore import explore
from kinetics.assembly.deriving.history import random_growth
from kinetics.assembly.deriving.mirror import same_to_rules
from kinetics.assembly.deriving.order import stages, stages_in_words
from kinetics.assembly.deriving.ways import squeezes
from kinetics.assembly.rules.rule_book import RuleBook

MOST_STRUCTURES = 4000


class WrongBookError(RuntimeError):
    """A compiled book does not build its target: a fault of the compiler."""

    def __init__(self, book: RuleBook, fault: object):
        super().__init__(f"the book compiled for {book.name!r} is wrong, please report it: {fault}")


def explored(book: RuleBook, progress: Callable[[int, int], None] | None = None) -> tuple[str, ...]:
    """What trying every event of a seeded book has shown, a sentence each; WrongBookError if anything is wrong, or
    a cube is squeezed in.
    """
    assert book.target is not None  # noqa: S101  the compiler's books have one
    found = explore(book, len(book.target), MOST_STRUCTURES, first_beyond=True, progress=progress)
    if found.stopped and found.beyond is None and not found.livelocks and not found.squeezed:
        return (f"explored again as a book only in part: {found.stopped}",)
    report = report_of(ExplorationIndex(found, progress), slow_waves=False)
    for finding in report.findings:
        if finding.is_error or finding.kind == "squeezed":
            raise WrongBookError(book, finding)
    events = (
        f"every event of the book explored: {report.n_structures} structures up to rotation, all of which become the "
        "target and no more, none by squeezing a cube in"
    )
    order = stages_in_words(stages(found.structures, found.events, book.scheme))
    return events, order, f"recoverability: {report.recoverability.text}"


def grown(book: RuleBook, runs: int, seed: int, budget: Budget, report: Notify) -> tuple[str, ...]:
    """What letting a seeded book grow at random has shown; WrongBookError where a growth does not end in the target.

    Ctrl-C after the first growth ends it.
    """
    assert book.target is not None  # noqa: S101
    done, tight = 0, 0
    try:
        while done < runs:
            frames = random_growth(book, seed + done, len(book.target) + 1)
            if not same_to_rules(frames[-1], book.target, book.scheme):
                raise WrongBookError(book, f"growth {seed + done} ends with {len(frames[-1])} cubes: {frames[-1]}")
            tight += sum(squeezes(frame, len(frame) - 1) for frame in frames[1:])
            done += 1
            report(f"random growth {done} of {runs}")
            budget.check()
    except KeyboardInterrupt:
        if not done:
            raise
    return (
        f"{done} random growths, seeds {seed} to {seed + done - 1}, all end in the target",
        f"{tight / done:.2g} cubes a growth come in between two opposite ones, on average",
    )
