"""The accuracy diagram of the kinetics: CPU time and error of every method at every setting."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.transient import Distribution, Transient
from kinetics.network import Model, Network
from kinetics.sampling.statistics import EnsembleStatistics
from kinetics.support.arrays import Counts, rising_times
from kinetics.support.datasets import dataframe
from kinetics.support.packages import pd
from kinetics.support.shown import ResultTable, Shown, Tabular
from kinetics.support.tables import text_table
from kinetics.trust.accuracy.curves import CURVES, Curve, Result, Task, shape_of
from kinetics.trust.accuracy.distances import Distance, Marginals, sampling_floor

REFERENCE = Transient(tolerance=1e-16)
FIRST_RUNS, MOST_RUNS = 16.0, 5000.0  # of a pilot, which stops after about so many CPU s
PILOT_SECONDS = 0.2
COMPILING = 10.0  # s; what takes less at first is tried again, in case it compiled
PILOT_TIMES = 6  # of those asked for; their cost foretells that of all

Timed = Callable[[Callable[[], Any]], tuple[Any, float]]


@dataclass(frozen=True)
class CostPoint:
    """Cost and error of a method at one setting.

    repeats : how often it was tried; cpu_seconds : of one try, the median
    error : mean over the repeats; low, high : smallest and largest distance in copies among them
    bound : proven bound on the distance from the exact distribution, copies; None if none is proven
    chosen : of an accuracy that was asked for, the method that answered
    """

    curve: str
    knob: str
    setting: float | None
    label: str
    repeats: int
    cpu_seconds: float
    error: Distance
    low: float
    high: float
    bound: float | None
    chosen: str | None = None


@dataclass(frozen=True)
class LeftOut:
    """A setting that was not tried, and why."""

    curve: str
    label: str
    reason: str


@dataclass(frozen=True, repr=False)
class Diagram(Shown, Tabular):
    """All points, and their exact reference.

    times : (T,) tu at which the distributions are compared
    reference_bound : bound on the distance of the reference from the exact distribution, copies; smaller errors of
        others are differences from the reference and nothing more
    is_proven : whether that bound is proven, else an estimate
    floors : runs -> expected error of so many independent exact runs at the time when it is largest
    is_complete : whether all was tried that the budget allowed; not so if someone interrupted
    """

    title: str
    network: Network
    times: np.ndarray
    seed: int
    n_states: int
    reference_cpu: float
    reference_bound: float
    is_proven: bool
    points: tuple[CostPoint, ...]
    floors: dict[int, float]
    left_out: tuple[LeftOut, ...] = ()
    is_complete: bool = True
    cpu_seconds: float = field(compare=False, default=0.0)

    def of(self, curve: str) -> list[CostPoint]:
        """The points of one curve, in the order of its settings."""
        return [point for point in self.points if point.curve == curve]

    def slopes(self) -> dict[str, float]:
        """Exponent of the error against the number of runs, of each method that samples; -1/2 is expected."""
        found = {}
        for name in dict.fromkeys(point.curve for point in self.points if point.knob == "runs"):
            points = self.of(name)
            if len(points) > 1:
                runs, errors = [float(p.setting or 0) for p in points], [p.error.copies for p in points]
                found[name] = float(np.polyfit(np.log(runs), np.log(errors), 1)[0])
        return found

    def rows(self) -> list[dict[str, Any]]:
        """One flat row per point, for tables."""
        return [
            {
                "method": p.curve,
                "knob": p.knob or None,
                "setting": p.setting,
                "repeats": p.repeats,
                "cpu_seconds": p.cpu_seconds,
                "error_copies": p.error.copies,
                "error_low": p.low,
                "error_high": p.high,
                "bound_copies": p.bound,
                "total_variation": None if np.isnan(p.error.total_variation) else p.error.total_variation,
                "mean_copies": p.error.mean,
                "chosen": p.chosen,
                "floor_copies": self.floors.get(int(p.setting)) if p.knob == "runs" and p.setting else None,
            }
            for p in self.points
        ]

    def as_dict(self) -> dict[str, Any]:
        """The diagram as a dictionary, ready for JSON."""
        return {
            "title": self.title,
            "species": self.network.species,
            "times": self.times,
            "seed": self.seed,
            "states": self.n_states,
            "reference": {
                "cpu_seconds": self.reference_cpu,
                "bound_copies": self.reference_bound,
                "proven": self.is_proven,
            },
            "points": self.rows(),
            "slopes": self.slopes(),
            "left_out": [{"method": x.curve, "setting": x.label, "reason": x.reason} for x in self.left_out],
            "complete": self.is_complete,
            "cpu_seconds": self.cpu_seconds,
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per point."""
        return dataframe(self.rows())

    @property
    def headline(self) -> str:
        """One line: the network, and its size."""
        return (
            f"{self.title}: {self.n_states} states, {self.times.size} times to {self.times[-1]:g} tu, seed {self.seed}"
        )

    def summary(self) -> ResultTable:
        """One row a point; how they were measured, below."""
        heads = ("method", "setting", "CPU (s)", "error (copies)", "proven bound", "total variation", "error of a mean")
        rows = []
        for p in self.points:
            spread = f" ({p.low:.2g} to {p.high:.2g})" if p.knob == "runs" else ""
            bound = "-" if p.bound is None else f"{p.bound:.1e}"
            variation = "-" if np.isnan(p.error.total_variation) else f"{p.error.total_variation:.1e}"
            name, setting = p.curve, f"{p.knob} {p.label}".strip() + (f": {p.chosen}" if p.chosen else "")
            mean = f"{p.error.mean:.1e}"
            rows.append(
                (name, setting, f"{p.cpu_seconds:.3g}", f"{p.error.copies:.2e}{spread}", bound, variation, mean)
            )
        within = f"within {self.reference_bound:.1e} copies, {'proven' if self.is_proven else 'estimated'}"
        measured = [
            "error: largest Wasserstein distance of a species' distribution from the reference, over times and species",
            f"reference: {REFERENCE.name}, tolerance {REFERENCE.tolerance:g}, {self.reference_cpu:.3g} CPU s; {within}",
        ]
        lines = []
        slopes = [f"{name} {slope:.3f}" for name, slope in self.slopes().items()]
        if slopes:
            lines.append(f"exponent of the error against runs (-1/2 expected): {', '.join(slopes)}")
        lines += [f"left out: {x.curve} {x.label}: {x.reason}" for x in self.left_out]
        if not self.is_complete:
            lines.append("interrupted: only finished work is shown")
        return ResultTable(self.headline, heads, rows, [*measured, *lines])

    def __str__(self) -> str:
        table = self.summary()
        measured, others = table.notes[:2], table.notes[2:]  # what the table shows goes before it
        return "\n".join([self.headline, *measured, text_table(table.titles, table.rows), *others])


def measure(
    title: str,
    model: Model | Network,
    initial: Counts | None,
    times: ArrayLike,
    *,
    seed: int = 0,
    budget: float = 1200.0,
    curves: Sequence[Curve] = CURVES,
    report: Callable[[str], None] = lambda _: None,
    progress: Callable[[str], None] = lambda _: None,
    clock: Callable[[], float] = time.process_time,
) -> Diagram:
    """Ask every method for the marginals of all species at `times` (T,), tu, evenly spaced from 0; all in one thread.

    initial : counts at time 0 that go before the model's; None for these
    budget : CPU s; settings that are predicted not to fit in it, after all cheaper ones, are left out
    report : is given the predicted cost before anything is run; progress : what is at work
    clock : s; costs are differences of its readings
    ValueError: the states are too many for an exact solution. After Ctrl-C the diagram has what was finished, if any.
    """
    began = clock()
    timed = partial(_timed, clock)
    given = Model.of(model, initial)
    task = Task(given.network, given.initial, rising_times(times), seed)
    if task.times.size < PILOT_TIMES:
        raise ValueError(f"{task.times.size} times; the diagram needs at least {PILOT_TIMES}")
    progress("trying the reference")
    REFERENCE.solve(task.network, task.initial, task.times[:PILOT_TIMES])  # refuses before others work in vain
    prices, left_out = _prices(task, curves, progress, timed)
    total = sum(prices.values())
    report(f"{title}: {len(prices)} settings, predicted cost {total:.3g} CPU s, budget {budget:.3g}")
    progress("the reference")
    exact, reference_cpu = timed(partial(REFERENCE.solve, *task[:3]))
    marginals = Marginals.of(exact, task.network.species)
    bound = marginals.top * exact.error
    points: dict[tuple[Curve, float], CostPoint] = {}
    spent, is_complete = reference_cpu, True
    try:
        for (curve, setting), price in sorted(prices.items(), key=lambda item: item[1]):
            if spent + price > budget:
                left_out.append(LeftOut(curve.name, curve.label(setting), f"predicted {price:.3g} CPU s, over budget"))
                continue
            progress(f"{curve.name} {curve.label(setting)}, {spent:.3g} of {total:.3g} CPU s")
            try:
                points[curve, setting] = point = _point(task, curve, setting, marginals, timed)
            except ValueError as refusal:
                left_out.append(LeftOut(curve.name, curve.label(setting), str(refusal)))
                continue
            spent += point.repeats * point.cpu_seconds
    except KeyboardInterrupt:
        if not points:
            raise
        is_complete = False
    ordered = [points[c, s] for c in curves for s in c.settings if (c, s) in points]
    runs = sorted({int(p.setting) for p in ordered if p.knob == "runs" and p.setting})
    floors = {n: sampling_floor(marginals, n) for n in runs}
    used = clock() - began
    return Diagram(
        title, task.network, task.times, seed, len(exact.space), reference_cpu, bound, exact.is_bound,
        tuple(ordered), floors, tuple(left_out), is_complete, used,
    )  # fmt: skip


def _prices(
    task: Task, curves: Sequence[Curve], progress: Callable[[str], None], timed: Timed
) -> tuple[dict[tuple[Curve, float], float], list[LeftOut]]:
    """Predicted CPU s of every setting with its repeats, and the curves that cannot be tried at all."""
    prices, refused = {}, []
    for curve in curves:
        progress(f"trying {curve.name}")
        try:
            price = (_sampled_price if curve.is_sampled else _solved_price)(task, curve, timed)
        except ValueError as refusal:
            refused.append(LeftOut(curve.name, "", str(refusal)))
            continue
        for setting in curve.settings:
            prices[curve, setting] = price * curve.repeats(setting) * (setting if curve.is_sampled else 1.0)
    return prices, refused


def _sampled_price(task: Task, curve: Curve, timed: Timed) -> float:
    """CPU s of a run, from as many as take a fraction of a second."""
    curve.make(task, FIRST_RUNS, 0)  # compiles, or reads what was compiled before
    _, cost = timed(partial(curve.make, task, FIRST_RUNS, 0))
    runs = min(max(FIRST_RUNS, FIRST_RUNS * PILOT_SECONDS / max(cost, 1e-6)), MOST_RUNS)
    return timed(partial(curve.make, task, runs, 0))[1] / int(runs)


def _solved_price(task: Task, curve: Curve, timed: Timed) -> float:
    """CPU s of a solution, from one that goes to a few of the times."""
    short = task._replace(times=task.times[:PILOT_TIMES])
    make = partial(curve.make, short, curve.settings[-1], 0)
    _, cost = timed(make)
    if cost < COMPILING:
        _, cost = timed(make)
    return cost * (task.times.size - 1) / (PILOT_TIMES - 1)


def _point(task: Task, curve: Curve, setting: float, exact: Marginals, timed: Timed) -> CostPoint:
    costs: list[float] = []
    found: list[Distance] = []
    for repeat in range(curve.repeats(setting)):
        result, cost = timed(partial(curve.make, task, setting, repeat))
        costs.append(cost)
        if not found or curve.is_sampled:
            found.append(shape_of(result, task.network.species).distance(exact))
    copies = [one.copies for one in found]
    bound = None
    if isinstance(result, Distribution) and result.is_bound:
        # No event is more than `error` likelier or less likely than it is, at each count up to the largest.
        bound = exact.top * result.error
    return CostPoint(
        curve.name,
        curve.knob,
        setting if curve.knob else None,
        curve.label(setting),
        len(costs),
        float(np.median(costs)),
        Distance(*(float(np.mean(column)) for column in zip(*found, strict=True))),
        min(copies),
        max(copies),
        bound,
        _chosen(result) if curve.knob == "accuracy" else None,
    )


def _chosen(result: Result) -> str:
    """The kind of answer that an accuracy got."""
    return f"{result.runs} runs" if isinstance(result, EnsembleStatistics) else "solved"


def _timed(clock: Callable[[], float], make: Callable[[], Any]) -> tuple[Any, float]:
    """The result of a call, and its CPU time, s."""
    began = clock()
    made = make()
    return made, clock() - began
