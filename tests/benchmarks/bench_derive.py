"""CPU time of deriving a network and of the calls that it and the mechanics make most often.

python -m tests.benchmarks.bench_derive
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import click

from kinetics.assembly import RuleBook, Senses, Structure, check, derive
from kinetics.assembly.rules.conditions import Combination
from kinetics.assembly.structure import _canonical


def seconds(call: Callable[[], object], calls: int, repeats: int = 7) -> float:
    """Median CPU time of one call."""
    taken = []
    for _ in range(repeats):
        start = time.process_time()
        for _ in range(calls):
            call()
        taken.append((time.process_time() - start) / calls)
    return statistics.median(taken)


def main() -> None:
    """Print the table."""
    start = time.process_time()
    book = RuleBook.load("line4")
    first = derive(book)
    cold = time.process_time() - start
    quadmer = first.structures["quadmer"]
    snake = Structure(
        tuple((z % 3, z // 9, z // 3 % 3) for z in range(45)), tuple(z % 24 for z in range(45)), ("a",) * 45
    )
    view = book.view(first.structures["dimer"], 0, 5) or book.view(first.structures["dimer"], 0, 4)

    def fresh(name: str) -> object:
        _canonical.cache_clear()
        return derive(RuleBook.load(name))

    def sticky(scheme: str, max_cubes: int) -> object:
        _canonical.cache_clear()
        rule = Combination(rule="stick", becomes="a")
        permissive = RuleBook("sticky", ("a",), "a", Senses(faces=scheme), combine=(rule,))
        return derive(permissive, max_cubes, max_species=10_000, partial=True)

    rows = {
        "load and derive line4, first call": cold,
        "load and derive line4, nothing cached": seconds(lambda: fresh("line4"), 5),
        "load and derive t5, nothing cached": seconds(lambda: fresh("t5"), 5),
        "load and derive pyramid45": seconds(lambda: fresh("pyramid45"), 1, repeats=3),
        "check t5": seconds(lambda: check(RuleBook.load("t5")), 3),
        "all that sticks, one face type, 6 cubes": seconds(lambda: sticky("one", 6), 1, repeats=3),
        "all that sticks, two face types, 4 cubes": seconds(lambda: sticky("two", 4), 1, repeats=3),
        "all that sticks, two face types, 5 cubes": seconds(lambda: sticky("two", 5), 1, repeats=1),
        "canonical form, 4 cubes": seconds(lambda: _canonical.__wrapped__(quadmer, "two"), 2000),
        "canonical form, 45 cubes": seconds(lambda: _canonical.__wrapped__(snake, "two"), 500),
        "species_of, seen before": seconds(lambda: first.species_of(quadmer), 20_000),
        "view": seconds(lambda: book.view(quadmer, 0, 0), 20_000),
        "allows": seconds(lambda: book.allows(view, view), 100_000),
        "break a bond": seconds(lambda: book.break_bond(quadmer, 1, 2), 2000),
    }
    for name, value in rows.items():
        click.echo(f"{name:40s} {value * 1e6:12.2f} us")


if __name__ == "__main__":
    main()
