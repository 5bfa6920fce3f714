"""Predictions with an accuracy over 200 seeded networks and questions: whether it was kept, and at what cost.

    python -m tests.benchmarks.bench_accuracy [--first N] [--questions N] [--csv FILE]

Kept: no mean, standard deviation or probability shown is farther from the true one than was asked; true ones are exact
solutions, else many times the runs (`TRUTH`). Cost: CPU time of the whole prediction, over that of the best of three
choices made in hindsight, each timed in the same run: the exact solution and the projection, where they prove the
accuracy, and the fixed number of runs that keep it with 95 % confidence, which nobody knows beforehand; at least 16.
What was done counts as the best where it took less. What takes less than `NOTABLE` is done `AGAIN` times, each time
with a network made anew, and its least time counts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import count, pairwise
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from kinetics import Auto, FiniteStateProjection, Model, Transient, predict, simulate_statistics
from kinetics.predicting.job import Job
from kinetics.predicting.sampled_way import RunsUntil
from kinetics.predicting.solved_ways import error_reached, largest_counts, tolerance_for
from kinetics.predicting.stopping_rule import normals

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))
from accuracy_questions import Asked, question, share_of_accuracy

TRUTH, TRUTH_SECONDS = 16, 1.0  # times the runs of the answer, where nothing is exact; fewer where they take longer
PROBED = 128  # runs from which the number needed in hindsight comes
TIMED = 500  # runs that are timed; of more, about as many as take `TIMING`, and their number scales the rest
TIMING = 0.3  # s
PATIENCE = 2.0  # s allowed to a solution
CLASSES = (0.1, 0.01, 0.005, 0.002)  # s; questions by the cost of their best choice, for the table
NOTABLE = 0.1  # s; below, starting anything is what costs
AGAIN = 3
BUDGET = 1.0  # s, of a prediction; questions that are forecast to cost more are refused, and passed over


class Row(NamedTuple):
    """A question with its answer: share of the accuracy used, CPU s, and those of each choice in hindsight."""

    number: int
    kind: str
    asked: str
    method: str
    share: float
    cost: float
    best: str
    best_cost: float

    @property
    def ratio(self) -> float:
        """The cost over that of the best."""
        return self.cost / self.best_cost


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """The result, and its CPU time, s."""
    began = time.process_time()
    made = work()
    return made, time.process_time() - began


def least(number: int, work: Callable[[Asked], Any]) -> tuple[Any, float]:
    """The result of a question, made anew each time so that no choice profits from another, and its least CPU time."""
    cost = inf
    for _ in range(AGAIN):
        normals.cache_clear()
        made, again = timed(partial(work, question(number)))
        cost = min(cost, again)
        if cost >= NOTABLE:
            break
    return made, cost


def hindsight(number: int) -> tuple[dict[str, float], Any]:
    """CPU s of each choice that keeps the accuracy, and the exact distribution, if there is one."""
    asked = question(number)
    _, network, start, times, accuracy = asked
    costs, exact = {}, None
    tops = None
    try:
        method = Transient(max_states=300_000, max_seconds=PATIENCE)
        made, cost = least(number, lambda q: predict(Model(q.network, start), None, times, method))
        exact = made.result
        tops = exact.space.states.max(axis=0).astype(float)
        if error_reached(accuracy, exact, tops) <= accuracy.value:
            costs["exact"] = cost
        exact = exact if exact.is_bound else None
    except ValueError:
        pass
    tops = largest_counts(network, start) if tops is None else tops
    if accuracy.of == "distribution" or np.isfinite(tops).all():
        tolerance = min(max(tolerance_for(accuracy, tops) / 2, 1e-13), 1e-3)
        projection = FiniteStateProjection(tolerance, max_seconds=min(PATIENCE, 3 * min(costs.values(), default=inf)))
        try:
            made, cost = least(number, lambda q: predict(Model(q.network, start), None, times, projection))
            if error_reached(accuracy, made.result, tops) <= accuracy.value:
                costs["fsp"] = cost
        except ValueError:
            pass
    runs = needed(asked)
    few = min(runs, TIMED)
    cost = least(number, lambda q: predict(Model(q.network, start), None, times, "auto", few, 77, threads=1))[1]
    if runs > few:  # many more, so that what each costs stands out
        many = min(runs, max(2 * few, int(few * TIMING / cost)))
        more = timed(lambda: predict(Model(network, start), None, times, "auto", many, 77, threads=1))[1]
        cost += max(more - cost, 0.0) / (many - few) * (runs - few)
    costs["runs"] = cost
    return costs, exact


def needed(asked: Asked) -> int:
    """The fixed number of runs that keep the accuracy, from what `PROBED` other runs say of variances."""
    _, network, start, times, accuracy = asked
    job = Job(Model(network, start), times, seed=78, threads=1)
    runs = RunsUntil(job, accuracy, Auto().source(network, start, 78))
    if accuracy.of == "distribution":
        return int(runs.forecast())
    return max(16, int(runs.fixed_from(PROBED)))


def row(number: int) -> Row | None:
    """One question; None where its cost is beyond the budget."""
    asked = question(number)
    _, network, start, times, accuracy = asked
    within = replace(accuracy, budget=BUDGET)
    words = f"{accuracy.of} {accuracy.in_words}"
    try:
        made, cost = least(
            number,
            lambda q: predict(Model(q.network, start), None, times, method=within, seed=number, threads=1),
        )
    except ValueError as refusal:
        click.echo(f"{number:4} {asked.kind:7} {words:28} refused: {str(refusal)[:60]} ...")
        return None
    costs, exact = hindsight(number)
    name = made.method.partition(" ")[0].replace("auto", "runs")
    costs[name] = min(cost, costs.get(name, inf))  # what was done could have been chosen
    truth = exact
    if truth is None:
        many = int(min(TRUTH, max(4.0, TRUTH_SECONDS / cost)) * (made.runs or 10_000))
        truth = simulate_statistics(network, "auto", start, times, many, 10**6 + number, covariances=False)
    share = share_of_accuracy(accuracy, made.result, truth)
    best = min(costs, key=costs.__getitem__)
    return Row(number, asked.kind, words, made.method, share, cost, best, costs[best])


def report(rows: list[Row]) -> None:
    """The table."""
    by_kind = [(kind, [r for r in rows if r.kind == kind]) for kind in dict.fromkeys(r.kind for r in rows)]
    groups = [*by_kind, ("runs", [r for r in rows if r.method.startswith("auto")]), ("all", rows)]
    for low, high in pairwise((inf, *CLASSES, 0.0)):
        groups.append((f"best >= {high:g} s", [r for r in rows if high <= r.best_cost < low]))
    click.echo(f"\n{'group':14} {'number':>6} {'kept':>7} {'median ratio':>12} {'within 1.5':>10} {'all together':>12}")
    for name, group in groups:
        if group:
            ratios = np.array([r.ratio for r in group])
            kept = np.mean([r.share <= 1 for r in group])
            total = sum(r.cost for r in group) / sum(r.best_cost for r in group)
            kept_words = f"{name:14} {len(group):6} {kept:7.1%}"
            click.echo(f"{kept_words} {np.median(ratios):12.2f} {np.mean(ratios <= 1.5):10.0%} {total:12.2f}")


@click.command()
@click.option("--first", default=0, help="Number of the first question.")
@click.option("--questions", default=200, help="How many.")
@click.option("--csv", "csv_file", help="Add a line a question to this file.")
def main(first: int, questions: int, csv_file: str | None) -> None:
    """Print a line a question, and the table."""
    for warm in range(5):  # imports
        asked = question(warm)
        predict(Model(asked.network, asked.start), None, asked.times, method="20%", threads=1)
    rows = []
    for number in count(first):
        if len(rows) == questions:
            break
        made = row(number)
        if made is None:
            continue
        rows.append(made)
        click.echo(
            f"{number:4} {made.kind:7} {made.asked:28} {made.method:18} used {made.share:8.2g}  {made.cost:8.3f} s, "
            f"best {made.best:5} {made.best_cost:8.3f} s, ratio {made.ratio:6.2f}"
        )
        if csv_file:
            with Path(csv_file).open("a", encoding="utf-8") as out:
                out.write(",".join(map(str, made)) + "\n")
    report(rows)


if __name__ == "__main__":
    main()
