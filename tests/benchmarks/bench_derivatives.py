"""What derivatives by all rates cost beside the answer itself, and beside central differences, with their errors.

    python -m tests.benchmarks.bench_derivatives [--repeats 3]

Of the line of four with the rates of table III. Differences take two answers a channel; their error is the largest
distance to the derivatives relative to the largest of these, which is what the step leaves of a difference. Limits are
those of the derivatives, likewise. CPU seconds, the best of the repeats.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import click
import numpy as np

from kinetics.assembly import RuleBook, derive
from kinetics.markov import Chain, Sensitivity
from kinetics.markov.questions import parse
from kinetics.rates import Rates
from kinetics.support.tables import text_table

STEP = 1e-4  # relative; a difference is right to its square, or to the answer's digits over it
CASES = (
    (40, "", 'R{"quadmer"}=? [ I=2000 ]'),
    (60, "", 'R{"quadmer"}=? [ I=2000 ]'),
    (120, "", 'R{"quadmer"}=? [ I=2000 ]'),
    (60, "", 'R{"quadmer"}=? [ C<=2000 ]'),
    (60, "", "P=? [ F<=500 quadmer >= 3 ]"),
    (60, "quadmer >= 3", 'R{"monomer"}=? [ F quadmer >= 3 ]'),
    (40, "", 'R{"quadmer"}=? [ S ]'),
    (8, "", 'R{"quadmer"}=? [ I=1e8 ]'),
)


@click.command()
@click.option("--repeats", type=click.IntRange(min=1), default=3, show_default=True)
def main(repeats: int) -> None:
    """Print the table."""
    network = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    rows = []
    for cubes, stop, question in CASES:
        chain = Chain.of(network, {"monomer": cubes}, stop=stop or None)
        asked = parse(question)
        answer_seconds, _ = timed(lambda chain=chain, asked=asked: asked.value(chain), repeats)
        seconds, found = timed(lambda chain=chain, asked=asked: asked.derivatives(Sensitivity(chain)), repeats)
        difference_seconds, differences = timed(
            lambda cubes=cubes, stop=stop, asked=asked: by_differences(network, cubes, stop, asked), 1
        )
        largest = np.abs(found.value).max()
        rows.append(
            (
                f"{question}, {cubes} cubes",
                str(len(chain)),
                f"{answer_seconds:.3g}",
                f"{seconds:.3g}",
                f"{seconds / answer_seconds:.1f}",
                f"{(found.high - found.low).max() / 2 / largest:.1e}" + ("" if found.is_bound else " (estimate)"),
                f"{difference_seconds / seconds:.0f}",
                f"{np.abs(differences - found.value).max() / largest:.1e}",
            )
        )
    titles = (
        "question",
        "states",
        "answer (s)",
        "derivatives (s)",
        "ratio",
        "limits",
        "differences: times as long",
        "off by",
    )
    click.echo(text_table(titles, rows))


def by_differences(network: Any, cubes: int, stop: str, asked: Any) -> np.ndarray:
    """Derivatives by the logarithm of each rate constant, by central differences."""
    found = []
    for r in range(len(network.channels)):
        ends = []
        for factor in (1 + STEP, 1 - STEP):
            rates = np.array(network.known_rates, dtype=float)
            rates[r] *= factor
            chain = Chain.of(network.with_rates(rates), {"monomer": cubes}, stop=stop or None)
            ends.append(asked.value(chain).value)
        found.append((ends[0] - ends[1]) / (2 * STEP))
    return np.array(found)


def timed(work: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """The least CPU time of some repeats, and what came out."""
    best, result = float("inf"), work() if repeats > 1 else None  # kernels are compiled before the clock runs
    for _ in range(repeats):
        began = time.process_time()
        result = work()
        best = min(best, time.process_time() - began)
    return best, result


if __name__ == "__main__":
    main()
