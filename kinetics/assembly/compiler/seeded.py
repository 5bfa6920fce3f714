"""Rule books for large targets, grown cube by cube from a seed.

Two routes. With two face types, the target is filled orbit by orbit in stages (`stages`, `waves`) and then letters are
merged (`merging`). With six, it grows along a spanning tree (`spanning`), which is always possible, but each cube then
fits at one face and one twist alone, and may have to slip in between two others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from kinetics.assembly.compiler.budget import Budget, OutOfStepsError
from kinetics.assembly.compiler.courses import AXES, minus, planned_course
from kinetics.assembly.compiler.merging import ReadingTables, letter_name, named, reduced
from kinetics.assembly.compiler.result import Compiled, InfeasibleError, Notify, UndecidedError, sensing
from kinetics.assembly.compiler.spanning import centre, distances, spanning_tree
from kinetics.assembly.compiler.tables import FREE, rules_of
from kinetics.assembly.compiler.target import Target
from kinetics.assembly.compiler.verifying import GROWTHS, MOST_STRUCTURES, exhausted, grown
from kinetics.assembly.compiler.waves import facts_of
from kinetics.assembly.deriving.order import stages_in_words
from kinetics.assembly.rules.conditions import BookTarget, Semantics, Senses
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

TIME_LIMIT = 600.0  # s
SEARCHING = 0.7  # of the time may go into the search, the rest is for the checks
# Steps for one kind of senses: orbits tried, states explored, merges tried, cubes hung elsewhere.
RUNG_STEPS, COURSE_STEPS = 1_000_000, 200_000  # for all, and for the order of growth
TRIES = 300  # orders of merging
MOVES = 5000  # from each start of the search for a tree
SIX = Senses(faces="six", roll=True)
LADDER = (
    Senses(faces="two", roll=True, touched=True),
    Senses(faces="two", roll=True, across=True, touched=True),
    SIX,
)  # tried in this order where the target names no senses; what of it is not needed is then left out
HOLD = Semantics(bonds="hold")
SLOW_WAVES = "slow internal waves: left out; each wave is taken to rest before the next cube docks"


@dataclass(frozen=True)
class _Draft:
    """A book before its last check; is_minimal, searched and verified as in Compiled."""

    book: RuleBook
    is_minimal: bool
    searched: str
    verified: tuple[str, ...]


def compile_seeded(
    target: Target,
    *,
    max_letters: int | None = None,
    time_limit: float = TIME_LIMIT,
    seed: int = 0,
    tries: int = TRIES,
    growths: int = GROWTHS,
    progress: Notify | None = None,
    budget: Budget | None = None,
) -> Compiled:
    """A rule book that grows the target from a seed; bonds hold, free cubes come one at a time.

    max_letters : most letters; None: what the target says, or any number
    time_limit : s of wall time for all of it; after seven tenths, the best book so far is checked
    seed : of the search and of the random growths; the same seed gives the same book, if time does not run out
    tries : orders in which letters are merged (two face types)
    growths : random ones that the book has to pass
    progress : called with what is being done
    budget : where the work has begun already; None: time counts from now
    Where the target names no senses, those of LADDER are tried, and what is not needed is left out.
    Ctrl-C ends the search for fewer letters; the best book so far is still checked. Another one ends the checks, too,
    once they have found it right a first time; `verified` says how far they came.
    InfeasibleError: no book of this kind with this sensing. UndecidedError: none found, or none with so few letters.
    """
    if target.breaks:
        raise ValueError(
            f"target {target.name!r}: the bonds of a book that grows from a seed hold, since news that a stage is "
            "complete is not taken back; set breaks = false"
        )
    if target.joins is not None:
        raise ValueError(f"target {target.name!r}: from a seed, cubes come one at a time; leave out joins")
    if not time_limit > 0 or tries < 1 or growths < 1:
        raise ValueError(f"time_limit = {time_limit} s, tries = {tries}, growths = {growths}; all must be more than 0")
    report = progress or (lambda _: None)
    budget = budget or Budget(time_limit)
    ruled: list[str] = []
    try:
        draft = _draft(target, seed, tries, budget, report, ruled)
        most = target.max_letters if max_letters is None else max_letters
        if most is not None and len(draft.book.letters) > most:
            raise UndecidedError(
                f"target {target.name!r} with {sensing(draft.book.senses)}: not found within {tries} tries; the best "
                f"book has {len(draft.book.letters)} letters, max_letters is {most}"
            )

        def following(n: int, every: int) -> None:
            report(f"random growth {n} of {every}")
            budget.check()

        found = grown(draft.book, growths, seed, following)
    except TimeoutError:
        raise UndecidedError(_too_late(target, time_limit, ruled)) from None
    if found.fault:
        raise RuntimeError(f"the book compiled for {target.name!r} is wrong, please report it: {found.fault}")
    verified = (
        *draft.verified,
        f"{found.runs} random growths, seeds {seed} to {seed + found.runs - 1}, all end in the target",
        f"{found.squeezed:.2g} cubes a growth come in between two opposite ones, on average",
        SLOW_WAVES if draft.book.internal else "slow internal waves: none, as there are no internal rules",
    )
    weaker = tuple(f"weaker senses: {reason}" for reason in ruled)
    return Compiled(draft.book, draft.is_minimal, (), (*weaker, draft.searched), verified, None)


def _too_late(target: Target, time_limit: float, ruled: list[str]) -> str:
    """What was decided before time was up, and what comes next."""
    rungs = LADDER if target.senses is None else (target.senses,)
    rest = [sensing(senses) for senses in rungs[len(ruled) :]]
    last = f"; next: {'; '.join(rest[1:])}" if rest[1:] else ""
    so_far = "\n".join(ruled) or "nothing"
    return (
        f"target {target.name!r}: not decided within {time_limit:g} s\nso far: {so_far}\nat work: "
        f"{rest[0] if rest else 'random growths'}{last}. Allow more time, or name senses"
    )


def _draft(target: Target, seed: int, tries: int, budget: Budget, report: Notify, ruled: list[str]) -> _Draft:
    """A book with the senses asked for, or those that are enough; ruled takes why weaker ones are not."""
    undecided = False
    for senses in LADDER if target.senses is None else (target.senses,):
        report(f"trying {sensing(senses)}")
        try:
            with budget.at_most(RUNG_STEPS):
                if senses.faces == "six":
                    return _by_tree(target, senses, seed, budget, report)
                return _by_stages(target, senses, seed, tries, budget, report)
        except (InfeasibleError, UndecidedError) as error:
            undecided |= isinstance(error, UndecidedError)
            ruled.append(str(error))
        except OutOfStepsError:
            undecided = True
            ruled.append(f"target {target.name!r} with {sensing(senses)}: no book in the steps allowed")
    raise (UndecidedError if undecided else InfeasibleError)("\n".join(ruled))


def _by_tree(target: Target, senses: Senses, seed: int, budget: Budget, report: Notify) -> _Draft:
    """Along a spanning tree; the cubes turn as the letters need it."""
    if not senses.roll:
        raise UndecidedError(
            f"target {target.name!r} with {sensing(senses)}: a cube docks at any of four twists, and nothing says "
            "which; set roll = true in its senses"
        )
    if target.tops is not None:
        raise UndecidedError(
            f"target {target.name!r} with {sensing(senses)}: the turns of the cubes are chosen so that few letters are "
            "needed; leave out tops and fronts (and draw cubes as #)"
        )
    places = target.positions
    root = target.seed or centre(places)
    with budget.within(SEARCHING):
        tree = spanning_tree(
            places,
            root,
            np.random.default_rng(seed),
            MOVES,
            lambda t: report(f"a tree with {len(t.letters)} letters"),
            budget.step,
        )
    names = {kind: letter_name(number) for number, kind in enumerate(tree.letters, 1)}
    letters = {place: names[kind] for place, (kind, _) in tree.hung.items()}
    finished = Structure(places, tuple(tree.rotations[p] for p in places), tuple(letters[p] for p in places))
    book = RuleBook(
        target.name, (FREE, *names.values()), FREE, senses, finished, letters[root], HOLD, tuple(tree.rules(names))
    )
    bound = max(distances(places, root).values()) + 1
    verified = (
        f"a spanning tree of {len(names)} different subtrees; from this seed it takes at least {bound}",
        "no rule reads what else is there, so what comes to a face does not depend on the order of growth",
        "order: a cube may come as soon as the one that it hangs on in the tree is there; no other order is kept",
    )
    searched = (
        "kind of books: growth along a spanning tree of shortest paths from this seed, a letter for each subtree; "
        f"the fewest subtrees found by annealing, {MOVES} moves from each of 12 trees"
    )
    return _Draft(book, len(names) == bound, searched, verified)


def _by_stages(target: Target, senses: Senses, seed: int, tries: int, budget: Budget, report: Notify) -> _Draft:
    """Orbit by orbit, then with merged letters."""
    if senses.faces != "two":
        raise UndecidedError(
            f"target {target.name!r} with {sensing(senses)}: growth from a seed needs two or six face types; "
            'set faces = "two" in its senses'
        )
    with budget.at_most(COURSE_STEPS):
        course, root = planned_course(target, senses, budget.step)
    report(f"a growth in {len(course.stages)} stages; reading along")
    for weaker in _weaker(senses) if target.senses is None else (senses,):
        facts, seed_letter, final = facts_of(replace(course, senses=weaker), tick=budget.step)
        if facts.usable() is not None:
            senses = weaker
            break
    tables = ReadingTables.of(facts)
    best, rng = None, np.random.default_rng(seed)
    try:
        for number in range(1, tries + 1):
            with budget.within(1.0 if best is None else SEARCHING):
                found = reduced(tables, rng, budget.step)
            if best is not None and len(found.letters) > best[0][0]:
                continue
            names = named(found, seed_letter)
            rules = rules_of(found, names, senses)
            size = len(found.letters), sum(map(len, rules))
            if best is None or size < best[0]:
                best = size, names, rules
                report(f"{size[0] + 1} letters, {size[1]} rules after {number} tries")
    except (TimeoutError, OutOfStepsError, KeyboardInterrupt):
        if best is None:
            raise
    assert best is not None  # noqa: S101  there is at least one try
    _, names, rules = best
    tops = tuple(AXES[course.axes[minus(p, root)]] for p in target.positions)
    letters = tuple(names[final[minus(p, root)]] for p in target.positions)
    finished = BookTarget(cubes=target.positions, letters=letters, tops=tops).structure()
    book = RuleBook(
        target.name, (FREE, *dict.fromkeys(names.values())), FREE, senses, finished, names[seed_letter], HOLD,
        rules[0], (), rules[1],
    )  # fmt: skip
    merged = (
        f"letters were merged from {len(tables.letters)} such that nobody is misled in any of {facts.states} states "
        "(up to turns and mirrors) nor in the middle of a wave"
    )
    searched = (
        "kind of books: growth from this seed in one order of orbits, the first found without a clash; the fewest "
        f"letters, then rules, of {number} orders of merging; not proven the fewest"
    )
    return _Draft(book, False, searched, (merged, *_exhaustive(book, facts.states, budget, report)))


def _exhaustive(book: RuleBook, states: int, budget: Budget, report: Notify) -> tuple[str, ...]:
    """What exploring every event of the book says; RuntimeError where the book is wrong."""
    if states > MOST_STRUCTURES:
        return (f"not explored again as a book: more than {MOST_STRUCTURES} structures",)

    def following(n: int, every: int) -> None:
        report(f"explored {n} of {every} structures found")
        budget.check()

    found = exhausted(book, progress=following)
    if found.fault:
        raise RuntimeError(f"the book compiled for {book.name!r} is wrong, please report it: {found.fault}")
    if found.stopped:
        return (f"explored again as a book only in part: {found.stopped}",)
    return (
        (
            f"every event of the book explored: {found.structures} structures up to rotation, all of which become the "
            "target and no more, none by squeezing a cube in"
        ),
        stages_in_words(found.stages),
    )


def _weaker(senses: Senses) -> list[Senses]:
    """The same senses, some left out; the fewest first."""
    names = [name for name in ("across", "roll", "touched") if getattr(senses, name)]
    kept = (some for size in range(len(names) + 1) for some in combinations(names, size))
    return [Senses(faces=senses.faces, **dict.fromkeys(some, True)) for some in kept]
