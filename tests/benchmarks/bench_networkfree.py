"""Cost of growth without a network, beside the direct method where a network can be derived.

    python -m tests.benchmarks.bench_networkfree

CPU time, median of repeats. `first` is a single run with nothing remembered; `warm` is ten runs that share what was
met, shown where structures come again. A draw is a pair of faces or a bond; those that make no event are the price of
thinning. NFsim on line4's network took 8 to 60 us an event on a like machine.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import click

from kinetics.assembly import RuleBook, Senses, derive
from kinetics.assembly.rules.conditions import Combination
from kinetics.assembly.structure import _canonical
from kinetics.networkfree import Growths, grow
from kinetics.rates import ClassRates
from kinetics.support.tables import text_table

REPEATS = 5
STICKY = RuleBook("sticky", ("a",), "a", Senses(faces="one"), combine=(Combination(rule="stick", becomes="a"),))
CASES = (  # name, book, cubes, join and break in 1/tu, duration in tu
    ("line4", RuleBook.load("line4"), 60, 2e-3, 1e-2, 2000.0),
    ("line4", RuleBook.load("line4"), 6000, 2e-5, 1e-2, 200.0),
    ("t5", RuleBook.load("t5"), 60, 2e-3, 1e-2, 2000.0),
    ("pyramid45", RuleBook.load("pyramid45"), 200, 7e-5, 0.0, 1500.0),
    ("sticky", STICKY, 60, 1e-4, 1e-3, 400.0),
    ("sticky, bonds break", STICKY, 60, 1e-4, 0.3, 100.0),
    ("sticky", STICKY, 200, 1e-4, 1e-3, 400.0),
)


def cost(call: Callable[[], Growths]) -> tuple[float, Growths]:
    """Median CPU time, and what the last repeat made."""
    taken = []
    for _ in range(REPEATS):
        _canonical.cache_clear()
        began = time.process_time()
        made = call()
        taken.append(time.process_time() - began)
    return median(taken), made


def direct(book: RuleBook, rates: ClassRates, cubes: int, duration: float) -> float:
    """Microseconds an event of the direct method, ten runs, the network derived beforehand."""
    from kinetics import Direct

    network = rates.apply(derive(book))
    start = network.state({network.species[0]: cubes})
    Direct().sample_path(network, start, 1.0)
    taken = []
    for _ in range(REPEATS):
        began = time.process_time()
        events = sum(Direct().sample_path(network, start, duration, 1, run).times.size for run in range(10))
        taken.append((time.process_time() - began) / events)
    return median(taken) * 1e6


def main() -> None:
    """Print the table."""
    rows = []
    for name, book, cubes, join, break_, duration in CASES:
        rates = ClassRates.uniform(join, break_)
        seconds, one = cost(lambda: grow(book, rates, cubes, duration, 1, seed=1))  # noqa: B023 - called at once
        first = one.runs[0]
        several, ten = cost(lambda: grow(book, rates, cubes, duration, 10, seed=1))  # noqa: B023
        events = sum(run.times.size for run in ten.runs)
        draws = sum(run.draws for run in ten.runs)
        is_small = name in ("line4", "t5")
        rows.append(
            [
                name,
                str(cubes),
                f"{seconds:.3f}",
                str(first.times.size),
                f"{seconds / first.times.size * 1e6:.0f}",
                f"{several / events * 1e6:.0f}",
                f"{draws / events:.1f}",
                f"{several / draws * 1e6:.0f}",
                str(len({structure for run in ten.runs for structure in run.structures})),
                f"{direct(book, rates, cubes, duration):.2f}" if is_small else "-",
            ]
        )
    titles = ("book", "cubes", "first, s", "events", "us/event", "warm us/event", "draws/event", "us/draw")
    click.echo(text_table((*titles, "structures", "direct us/event"), rows))


if __name__ == "__main__":
    main()
