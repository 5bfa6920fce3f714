"""Seeded networks and questions of many kinds, to ask an accuracy of, and how far an answer was off."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from kinetics import Auto, Model, Network, Rates
from kinetics.assembly import RuleBook, derive
from kinetics.markov.transient import Distribution
from kinetics.predicting import AskedAccuracy
from kinetics.predicting.first_runs import first_runs
from kinetics.predicting.forced_firings import force_firings
from kinetics.predicting.job import Job
from kinetics.predicting.sampled_way import RunsUntil
from kinetics.sampling.statistics import EnsembleStatistics

SIZES = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
KINDS = ("closed", "open", "stiff", "large", "book")


class Asked(NamedTuple):
    """A network, where it starts, the times, and what is asked of it."""

    kind: str
    network: Network
    start: np.ndarray
    times: np.ndarray
    accuracy: AskedAccuracy


class Sampled(NamedTuple):
    """Statistics of runs, and the bound on their error in the unit of the accuracy."""

    statistics: EnsembleStatistics
    error: float


def question(seed: int) -> Asked:
    """The question of this number; kinds take turns."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    network, start, end = book(rng) if kind == "book" else random_network(kind, rng)
    n_times = int(rng.choice([1, 5, 11, 51]))
    of = str(rng.choice(["mean", "sd", "distribution"], p=[0.6, 0.2, 0.2]))
    size = float(rng.choice(SIZES))
    if kind == "large" and of == "distribution":
        of = "mean"  # statistics of so many counts have bins, whose ends alone could be compared
    if of == "mean" and rng.random() < 0.2:
        accuracy = AskedAccuracy(size * max(1.0, float(start.sum())) / 3)
    else:
        accuracy = AskedAccuracy(size, of != "distribution", of)
    return Asked(kind, network, start, np.linspace(0.0, end, n_times + 1)[1:], accuracy)


def book(rng: np.random.Generator) -> tuple[Network, np.ndarray, float]:
    """The line of four with measured rates, or other books with rates at random."""
    if rng.random() < 0.6:
        network = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
        return network, counts(network, int(rng.choice([20, 60, 120, 300, 600, 1000]))), 2000.0
    bare = derive(RuleBook.load(str(rng.choice(["t5", "line4_pairs"])))).network
    rates = 10.0 ** rng.uniform(-3, -1, len(bare.channels))
    network = bare.with_rates(rates)
    return network, counts(network, int(rng.choice([12, 30, 100]))), float(rng.choice([10, 100]))


def counts(network: Network, cubes: int) -> np.ndarray:
    """All cubes single."""
    start = np.zeros(len(network.species), dtype=np.int64)
    start[0] = cubes
    return start


def random_network(kind: str, rng: np.random.Generator) -> tuple[Network, np.ndarray, float]:
    """Conversions, joins and breaks among a few species at random; open ones also appear and decay."""
    n = int(rng.integers(2, 7))
    names = [f"S{i}" for i in range(n)]
    top = {"closed": 300, "open": 100, "stiff": 100, "large": 200_000}[kind]
    total = int(np.exp(rng.uniform(np.log(8), np.log(top)))) if kind != "large" else int(rng.integers(20_000, top))
    decades = 3.0 if kind == "stiff" else 0.5
    lines = [f"{names[0]} -> {names[1]}, {10.0 ** rng.uniform(-1, 1):.6g}"]
    for _ in range(int(rng.integers(n, 2 * n + 1))):
        a, b, c = (names[i] for i in rng.permutation(max(n, 3))[:3] % n)
        rate = 10.0 ** rng.uniform(-decades, decades)
        if rng.random() < 0.5 or n == 2:
            lines.append(f"{a} -> {b}, {rate:.6g}")
        elif rng.random() < 0.6:
            lines.append(f"{a} + {b} -> {c}, {rate / total:.6g}")
        else:
            lines.append(f"{a} -> {b} + {c}, {rate * 0.1:.6g}" if kind == "open" else f"{a} -> {c}, {rate:.6g}")
    if kind == "open":
        lines += [f"0 -> {names[0]}, {total:.6g}", *(f"{name} -> 0, {rng.uniform(0.5, 2):.6g}" for name in names)]
    else:
        lines.append(f"{names[-1]} -> {names[0]}, {10.0 ** rng.uniform(-1, 0):.6g}")
    network = Network.from_text("\n".join(dict.fromkeys(lines)))
    start = np.zeros(len(network.species), dtype=np.int64)
    start[network.index(names[0])] = 0 if kind == "open" else total
    return network, start, float(10.0 ** rng.uniform(-0.5, 1.0))


def share_of_accuracy(
    asked: AskedAccuracy, found: EnsembleStatistics | Distribution, truth: EnsembleStatistics | Distribution
) -> float:
    """The largest error over what was asked; at most 1 where the accuracy was kept."""
    if asked.of == "distribution":
        gaps = [
            np.abs(a - b).max()
            for s in range(len(truth.network.species))
            for a, b in zip(cumulative(found, s), cumulative(truth, s), strict=True)
        ]
        return max(gaps) / asked.value
    figures, true = (each.mean() if asked.of == "mean" else each.sd() for each in (found, truth))
    scale = np.maximum(true.max(axis=0), 1.0) if asked.is_relative else 1.0
    return float((np.abs(figures - true) / (asked.value * scale)).max())


def cumulative(found: EnsembleStatistics | Distribution, s: int, points: int = 4000) -> np.ndarray:
    """Probabilities (T, K) of at most 0, 1, ... copies of a species; of statistics at the ends of their bins."""
    at = np.arange(points)
    if isinstance(found, EnsembleStatistics):
        if found.shift[:, s].any():
            raise ValueError("bins are wider than one count")
        full = np.zeros((found.times.size, points))
        for row, first, tally in zip(full, found.origin[:, s], found.histogram[:, s], strict=True):
            seen = np.flatnonzero(tally)
            np.add.at(row, np.minimum(first + seen, points - 1), tally[seen] / found.runs)
        return full.cumsum(axis=1)
    full = np.zeros((found.times.size, points))
    copies = np.minimum(found.space.states[:, s], at[-1])
    for row, p in zip(full, found.probabilities, strict=True):
        np.add.at(row, copies, p)
    return full.cumsum(axis=1)


def sampled(
    asked: AskedAccuracy, network: Network, start: object, times: np.ndarray, seed: int, most: int = 10**9,
    with_forced: bool = True, **options: Any,
) -> Sampled:  # fmt: skip
    """Runs until they are enough, whatever else would be cheaper; options : of `RunsUntil`."""
    job = Job(Model(network, start), times, seed=seed, threads=1)
    method = Auto().choose(network, job.model.initial)
    source = method.source(network, job.model.initial, seed)
    first = first_runs(network, method, source, times, job.is_known.size, np.inf)
    forcing = partial(force_firings, network, source, first.seen, times, 32, seed)
    runs = RunsUntil(
        job, asked, source, run_seconds=first.seconds, first=first.counts,
        forcing=forcing if with_forced else lambda *_: None, **options,
    )  # fmt: skip
    runs.forecast()
    made = runs.finish(most)
    return Sampled(made.result, made.error)
