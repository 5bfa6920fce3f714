"""Cost and proven error of the exact methods: the paper's line, a million states, stiff and endless chains.

    python -m tests.benchmarks.bench_master_equation

CPU time, median of repeats; compilation and imports are made before. To be read beside the targets: 60, 80, 120 cubes
at 100 times until 2,000 tu with a bound of 1e-12 or less in 0.3, 0.7, 5 s; and scipy's expm_multiply for ONE time,
t = 500, on a like machine: 0.04 / 0.09 / 1.9 s, without a bound.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import click
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

REPEATS = 5


def timed(work: Callable[[], Any], repeats: int = REPEATS) -> tuple[Any, float]:
    """The result, and the median CPU time in seconds."""
    costs = []
    for _ in range(repeats):
        began = time.process_time()
        result = work()
        costs.append(time.process_time() - began)
    return result, median(costs)


def line_of_four() -> None:
    """The paper's line: states, generator, 100 times, first passage, stationary law."""
    from kinetics import FiniteStateProjection, Rates, Transient, first_passage, reachable, solve, stationary
    from kinetics.assembly import RuleBook, derive

    line = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    times = np.linspace(0.0, 2000.0, 101)[1:]

    def passage(start: list[int]) -> Any:
        return first_passage(line, start, "quadmer").quantile([0.025, 0.5, 0.975])

    for warm in (Transient(), FiniteStateProjection()):
        solve(line, warm, [4, 0, 0, 0], times)
    passage([4, 0, 0, 0])
    stationary(line, [4, 0, 0, 0])
    titles = ("states", "explore", "generator", "transient", "bound", "fsp", "bound", "passage", "stationary")
    click.echo("cubes  " + "  ".join(f"{title:>10}" for title in titles))
    for cubes in (60, 80, 120):
        start = [cubes, 0, 0, 0]
        space, exploring = timed(lambda start=start: reachable(line, start))
        _, generating = timed(space.generator)
        law, solving = timed(lambda start=start: solve(line, Transient(), start, times))
        part, projecting = timed(lambda start=start: solve(line, FiniteStateProjection(), start, times))
        _, passing = timed(lambda start=start: passage(start))
        _, resting = timed(lambda start=start: stationary(line, start))
        costs = f"{exploring:9.3f}s  {generating:9.3f}s  {solving:9.3f}s  {law.error:10.1e}  {projecting:9.3f}s"
        click.echo(f"{cubes:5}  {len(space):10}  {costs}  {part.error:10.1e}  {passing:9.3f}s  {resting:9.3f}s")
    law, solving = timed(lambda: solve(line, Transient(), [500, 0, 0, 0], [5.0, 10.0]), 1)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    click.echo(f"500 cubes, 2 times until 10 tu: {len(law.space)} states, {solving:.1f} s, bound {law.error:.1e}")
    click.echo(f"largest memory of the whole process so far: {memory:.2f} GB")


def small_and_stiff() -> None:
    """The dense method: a stiff chain of three states, and large random ones; what a proven bound costs."""
    from kinetics.markov.transient.certificate import Entries, distance
    from kinetics.markov.transient.dense import CERTIFIED, estimated_error, exponential_action

    for n, stiff in ((3, 1e15), (200, 1e6), (500, 1e3), (2000, 1e3)):
        rng = np.random.default_rng(1)
        rates = stiff * rng.random((n, n)) ** 8 * (rng.random((n, n)) < 10 / n)
        rates += np.diag(np.full(n - 1, 1e-3), 1) + np.diag(np.full(n - 1, 1e-3), -1)
        np.fill_diagonal(rates, 0.0)
        start, times, repeats = np.eye(1, n)[0], np.array([1.0]), 1 if n >= 500 else REPEATS
        p, cost = timed(lambda r=rates, s=start, t=times: exponential_action(r, s, t), repeats)
        guess, more = timed(lambda r=rates, s=start, t=times, p=p: estimated_error(r, s, t, p), repeats)
        text = f"{cost:.3f} s, estimated error {guess:.1e} in {more:.3f} s"
        if n <= CERTIFIED:
            entries = Entries(*np.nonzero(rates), rates[np.nonzero(rates)])
            bound, more = timed(lambda e=entries, s=start, t=times, p=p: distance(e, s, t, p), repeats)
            text += f", proven bound {bound:.1e} in {more:.3f} s"
        click.echo(f"dense, {n} states, q t = {rates.sum(axis=1).max():.1e}: {text}")


def large_and_stiff() -> None:
    """Collocation: 3,478 states with rates from 3e-8 to 3e-2 until 3.6e8, and a line long after it has settled."""
    from embedded_system import embedded_system
    from scipy.sparse import csr_array

    from kinetics import Collocation, Rates, solve
    from kinetics.assembly import RuleBook, derive
    from kinetics.markov.transient.collocation import CollocationPlan, integrate

    states, entries, _ = embedded_system()
    n, diagonal = len(states), np.arange(len(states))
    exits = np.bincount(entries.rows, entries.rates, minlength=n)
    places = np.append(entries.rows, diagonal), np.append(entries.columns, diagonal)
    generator = csr_array((np.append(entries.rates, -exits), places), shape=(n, n))
    start, times = np.eye(1, n)[0], np.array([3.6e8])
    for tolerance in (1e-9, 1e-12):
        plan = CollocationPlan.of(generator, times[-1], tolerance, np.inf)
        (_, error), cost = timed(partial(integrate, entries, start, times, plan, tolerance, np.inf), 3)
        text = f"q t = {exits.max() * times[-1]:.1e}, foretold {plan.seconds:.1f} s"
        click.echo(f"collocation, {n} states, {text}: {cost:.2f} s, proven bound {error:.1e}")
    line = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    law, cost = timed(lambda: solve(line, Collocation(1e-9), [60, 0, 0, 0], [1e7]), 1)
    click.echo(f"collocation, {len(law.space)} states of the line until 1e7 tu: {cost:.1f} s, bound {law.error:.1e}")


def endless() -> None:
    """Goutsias' transcription model (2005) until 100 s, by projection."""
    from kinetics import FiniteStateProjection, Network, solve

    reactions: Any = {
        "translate": ({"RNA": 1}, {"RNA": 1, "M": 1}),
        "decay M": ({"M": 1}, {}),
        "transcribe": ({"DNAD": 1}, {"DNAD": 1, "RNA": 1}),
        "decay RNA": ({"RNA": 1}, {}),
        "bind": ({"DNA": 1, "D": 1}, {"DNAD": 1}),
        "free": ({"DNAD": 1}, {"DNA": 1, "D": 1}),
        "bind two": ({"DNAD": 1, "D": 1}, {"DNA2D": 1}),
        "free two": ({"DNA2D": 1}, {"DNAD": 1, "D": 1}),
        "join": ({"M": 2}, {"D": 1}),
        "part": ({"D": 1}, {"M": 2}),
    }
    rates = [0.043, 0.0007, 0.0715, 0.0039, 0.01992647, 0.4791, 0.0001992647, 8.765e-12, 0.08830269, 0.5]
    net = Network.from_reactions(reactions, rates, ("M", "D", "RNA", "DNA", "DNAD", "DNA2D"))
    law, cost = timed(lambda: solve(net, FiniteStateProjection(1e-6), [2, 6, 0, 2, 0, 0], [100.0]), 1)
    click.echo(f"transcription until 100 s: {len(law.space)} states, {cost:.2f} s, bound {law.error:.1e}")


def main() -> None:
    """Print the tables."""
    line_of_four()
    small_and_stiff()
    large_and_stiff()
    endless()


if __name__ == "__main__":
    main()
