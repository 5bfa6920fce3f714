"""Rule books for large targets, grown cube by cube from a seed; bonds hold, free cubes come one at a time.

Two routes. With two face types, the target is filled orbit by orbit in stages (`growth_orders`, `waves`) and then
letters are merged (`merging`). With six, it grows along a spanning tree (`spanning`), which is always possible, but
each cube then fits at one face and one twist alone, and may have to slip in between two others.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from kinetics.assembly.compiler.budget import Budget, OutOfStepsError
from kinetics.assembly.compiler.growth_orders import minus, planned_order, roots
from kinetics.assembly.compiler.merging import letter_name, named, reduced, tables_of
from kinetics.assembly.compiler.orientation import AXES
from kinetics.assembly.compiler.result import Compiled, Notify, UndecidedError, sensing
from kinetics.assembly.compiler.spanning import distances, spanning_tree
from kinetics.assembly.compiler.tables import FREE, rules_of
from kinetics.assembly.compiler.target import Target
from kinetics.assembly.compiler.verifying import MOST_STRUCTURES, explored, grown
from kinetics.assembly.compiler.waves import facts_of
from kinetics.assembly.rules.conditions import BookTarget, Semantics, Senses
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

SEARCHING = 0.7  # of the time may go into the search, the rest is for the checks
# Steps for one kind of senses: orbits tried, states explored, merges tried, cubes hung elsewhere.
RUNG_STEPS, ORDER_STEPS = 1_000_000, 200_000  # for all, and for the order of growth
TRIES, GROWTHS = 300, 500  # orders of merging, and random growths that a book has to pass; times the effort
MOVES = 5000  # from each start of the search for a tree
LADDER = (
    Senses(faces="two", roll=True, touched=True),
    Senses(faces="two", roll=True, across=True, touched=True),
    Senses(faces="six", roll=True),
)  # tried in this order where the target names no senses; what of it is not needed is then left out
HOLD = Semantics(bonds="hold")


def grown_book(target: Target, senses: Senses, seed: int, budget: Budget, report: Notify) -> Compiled:
    """A rule book that grows the target from a seed, by cubes with these senses.

    seed : of the search and of the random growths; the same seed gives the same book, if time does not run out
    After seven tenths of the time the best book so far is checked. Ctrl-C ends the random growths among the checks,
    once one has found it right; `verified` says how far they came.
    InfeasibleError: no book of this kind with this sensing. UndecidedError: none found, or none with so few letters.
    """
    by = _by_tree if senses.faces == "six" else _by_stages
    made = by(target, senses, seed, budget, report)
    if target.max_letters is not None and made.letters > target.max_letters:
        raise UndecidedError(
            f"target {target.name!r} with {sensing(made.book.senses)}: not found; the best book has {made.letters} "
            f"letters, max_letters is {target.max_letters}"
        )
    if made.book.internal:
        waves = "left out; all state updates are assumed to finish before the next cube docks"
    else:
        waves = "none, as there are no internal rules"
    growths = grown(made.book, budget.times(GROWTHS), seed, budget, report)
    return replace(made, verified=(*made.verified, *growths, f"delayed state updates: {waves}"))


def _by_tree(target: Target, senses: Senses, seed: int, budget: Budget, report: Notify) -> Compiled:
    """Along a spanning tree; the cubes turn as the letters need it."""
    if not senses.roll:
        raise UndecidedError(
            f"target {target.name!r} with {sensing(senses)}: a cube docks at any of four twists, and nothing says "
            "which; set roll = true in its senses"
        )
    if target.tops is not None:
        raise UndecidedError(
            f"target {target.name!r} with {sensing(senses)}: the orientations of the cubes are chosen so that few "
            f"letters are needed; leave out tops and fronts (and draw cubes as #)"
        )
    places, root = target.positions, roots(target)[0]
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
        "no rule reads anything else, so what docks at a face does not depend on the order of growth",
        "order: a cube may dock as soon as its parent in the tree has docked; no other order is kept",
    )
    searched = (
        "kind of books: growth along a spanning tree of shortest paths from this seed, a letter for each subtree; "
        f"the fewest subtrees found by annealing, {MOVES} moves from each of 12 trees"
    )
    return Compiled(book, len(names) == bound, (), (searched,), verified, None)


def _by_stages(target: Target, senses: Senses, seed: int, budget: Budget, report: Notify) -> Compiled:
    """Orbit by orbit, then with merged letters."""
    if senses.faces != "two":
        raise UndecidedError(
            f"target {target.name!r} with {sensing(senses)}: growth from a seed needs two or six face types; "
            'set faces = "two" in its senses'
        )
    with budget.at_most(ORDER_STEPS):
        order, root = planned_order(target, senses, budget.step)
    report(f"a growth in {len(order.stages)} stages; reading along")
    for weaker in _weaker(senses) if target.senses is None else (senses,):
        facts, seed_letter, final = facts_of(replace(order, senses=weaker), budget.step)
        tables = tables_of(facts)
        if tables is not None:
            senses = weaker
            break
    assert tables is not None  # noqa: S101  the order was planned without a clash
    best, rng = None, np.random.default_rng(seed)
    try:
        for number in range(1, budget.times(TRIES) + 1):
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
    except (TimeoutError, OutOfStepsError):
        if best is None:
            raise
    assert best is not None  # noqa: S101  there is at least one try
    _, names, rules = best
    tops = tuple(AXES[order.axes[minus(p, root)]] for p in target.positions)
    letters = tuple(names[final[minus(p, root)]] for p in target.positions)
    finished = BookTarget(cubes=target.positions, letters=letters, tops=tops).structure()
    book = RuleBook(
        target.name, (FREE, *dict.fromkeys(names.values())), FREE, senses, finished, names[seed_letter], HOLD,
        rules[0], (), rules[1],
    )  # fmt: skip

    def following(n: int, every: int) -> None:
        report(f"explored {n} of {every} structures found")
        budget.check()

    merged = (
        f"letters were merged from {len(tables.letters)} such that no cube is misled in any of {facts.states} states "
        "(up to turns and mirrors) nor in the middle of a wave"
    )
    if facts.states > MOST_STRUCTURES:
        events: tuple[str, ...] = (f"not explored again as a book: more than {MOST_STRUCTURES} structures",)
    else:
        events = explored(book, following)
    searched = (
        "kind of books: growth from this seed in one order of orbits, the first found without a clash; the fewest "
        f"letters, then rules, of {number} orders of merging; not proven the fewest"
    )
    return Compiled(book, False, (), (searched,), (merged, *events), None)


def _weaker(senses: Senses) -> list[Senses]:
    """Subsets of these senses, the smallest first."""
    names = [name for name in ("across", "roll", "touched") if getattr(senses, name)]
    kept = (some for size in range(len(names) + 1) for some in combinations(names, size))
    return [Senses(faces=senses.faces, **dict.fromkeys(some, True)) for some in kept]
