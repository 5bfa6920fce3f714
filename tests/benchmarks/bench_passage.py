"""Questions about a chain ever and by a time: proven errors, and cost as ratios within one run.

    python -m tests.benchmarks.bench_passage

CPU time, median of repeats; compilation and imports are made before.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import click
import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from tests.benchmarks.bench_master_equation import timed


def line_chain(cubes: int) -> Any:
    """The paper's line from so many cubes."""
    from kinetics import Chain, Rates
    from kinetics.assembly import RuleBook, derive

    line = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    return Chain.of(line, [cubes, 0, 0, 0])


def lattice(side: int) -> Any:
    """Steps to all four neighbours at random rates of 0.5 to 2, from one corner."""
    from kinetics import Chain

    rng, place = np.random.default_rng(1), np.arange(side * side).reshape(side, side)
    pairs = [(place[:-1], place[1:]), (place[:, :-1], place[:, 1:])]
    rows = np.concatenate([end.ravel() for a, b in pairs for end in (a, b)])
    columns = np.concatenate([end.ravel() for a, b in pairs for end in (b, a)])
    return Chain(csc_array((rng.uniform(0.5, 2.0, rows.size), (rows, columns)), shape=(side**2, side**2)), 0)


def three_ways(name: str, chain: Any, target: Any) -> None:
    """Iteration, elimination and sparse factors: the same question, its proven error and its cost."""
    from kinetics.markov.passage import elimination, equations

    resting_place = import_module("kinetics.markov.passage.stationary")
    most, choice = elimination.MAX_WORK, equations.is_easy
    costs = []
    for way, is_easy, work in (("iteration", False, most), ("elimination", True, most), ("factors", True, 0)):
        elimination.MAX_WORK = work
        equations.is_easy = resting_place.is_easy = lambda *_, easy=is_easy: easy  # type: ignore[attr-defined]
        passage, passing = timed(lambda: chain.passage(target), 3)
        law, resting = timed(chain.stationary, 3)
        costs.append((passing, resting))
        click.echo(
            f"{name}, {len(chain)} states: mean to {passage.error:.1e}, stationary law to {law.error:.1e} by {way}, in "
            f"{passing / costs[0][0]:.1f} and {resting / costs[0][1]:.1f} times what iteration takes"
        )
    elimination.MAX_WORK = most
    equations.is_easy = resting_place.is_easy = choice  # type: ignore[attr-defined]


def orderings(name: str, chain: Any, target: Any) -> None:
    """Sparse LU before the target: the ordering in use beside SuperLU's own and a narrow band."""
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    before = ~chain.states(target)
    matrix = csc_array(-chain.transitions.generator().tocsr()[before][:, before])
    order = reverse_cuthill_mckee((matrix + matrix.T).tocsr(), symmetric_mode=True)
    banded = csc_array(matrix.tocsr()[order][:, order])
    plain: dict[str, Any] = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    _, used = timed(lambda: splu(matrix, permc_spec="MMD_AT_PLUS_A", **plain), 3)
    _, own = timed(lambda: splu(matrix), 3)
    _, band = timed(lambda: splu(banded, permc_spec="NATURAL", **plain), 3)
    click.echo(
        f"{name}, {matrix.shape[0]} states: default ordering {own / used:.1f}, band {band / used:.1f} times as long"
    )


def early_times(chain: Any, target: str) -> None:
    """Small probabilities by the pass backwards, beside the pass forwards to the median."""
    passage = chain.passage(target)
    median, common = timed(lambda: chain.passage(target).quantile(0.5), 3)
    times = median * np.array([1e-12, 1e-6, 1e-3])
    (low, high), cost = timed(lambda: chain.passage(target).cdf_bounds(times), 3)
    widths = ", ".join(f"{a:.1e} to {b / a - 1:.0e}" for a, b in zip(low, high, strict=True))
    click.echo(f"{passage.target}: cdf {widths} relative, in {cost / common:.2f} of the time for a median")


def within(cubes: int) -> None:
    """A part of the line: how many states, and what the limits leave open."""
    from kinetics import Chain, Rates
    from kinetics.assembly import RuleBook, derive

    line = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    whole = Chain.of(line, [cubes, 0, 0, 0])
    click.echo(f"all {len(whole)} states: {whole.until('quadmer >= 2', by=100.0)}")
    for part in ("trimer <= 4 and quadmer <= 2", "trimer <= 8 and quadmer <= 2", "trimer <= 13 and quadmer <= 2"):
        chain = Chain.of(line, [cubes, 0, 0, 0], truncate=part)
        click.echo(f"within {part}, {len(chain)} states: {chain.until('quadmer >= 2', by=100.0)}")


def main() -> None:
    """Print the figures."""
    for cubes in (40, 60, 88):
        three_ways(f"line of four, {cubes} cubes", line_chain(cubes), "quadmer >= 1")
    three_ways("lattice", lattice(70), np.arange(4900) == 4899)
    for cubes in (60, 100):
        orderings(f"line of four, {cubes} cubes", line_chain(cubes), f"quadmer >= {cubes // 8}")
    orderings("lattice", lattice(100), np.arange(10_000) == 9999)
    early_times(line_chain(40), "quadmer >= 1")
    within(60)


if __name__ == "__main__":
    main()
