"""`scan`: questions to a model at every point of a grid."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from pathlib import Path

from numpy.typing import ArrayLike

from kinetics.network import Model, Network
from kinetics.network.checks import some_names
from kinetics.network.model import CHANNEL, CONSERVED, SPECIES
from kinetics.predicting.scanning.answering import ScanRequest, answers_at, check_asked, tell_questions
from kinetics.predicting.scanning.checkpoints import Checkpoints
from kinetics.predicting.scanning.executors import executor_of, results
from kinetics.predicting.scanning.result import RESERVED, Scan, grid_points
from kinetics.predicting.scanning.values import check_size, checked_values
from kinetics.sampling.streamed import unbroken
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, integers, whole_number
from kinetics.support.cli.progress import forecast, span
from kinetics.support.tables import counted, inverse, of_unit

LONG = 5.0  # s of CPU; if a point takes longer, no further one is tried first
MAX_STATES = 100_000  # listed at a point; a chain of so many takes seconds to minutes


def scan(
    model: Model | Network,
    over: Mapping[str, ArrayLike],
    ask: str | Sequence[str],
    *,
    max_states: int = MAX_STATES,
    truncate: str | int | None = None,
    runs: int = 1000,
    seed: int = 0,
    workers: int | str = 1,
    folder: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Scan:
    """Answer questions at every combination of values.

    model : a network with its rates, or a model, as `read` gives it
    over : name -> values: a parameter, a rate constant by its channel, the count of a species at time 0, or `cubes`,
        see `Model.kind`
    ask : questions as `wellmixed ask` takes them, such as "E[AB] @ 100" or "P=? [ F<=100 AB >= 5 ]"
    max_states : a point that can reach more is sampled, as is one whose rates depend on time; 0: every point
    truncate : condition of the states that a chain is truncated to, or their number, as in `Chain.of`
    runs : of each point that is sampled; at least 2
    workers : number of processes on this machine, or the address of a Dask scheduler, whose workers answer
    folder : keeps the points as they come; what is there already is not made again
    progress : called with how far it is and, once the first points are done, with a sentence on the cost of the others

    Exact answers have proven bounds unless they say otherwise, sampled ones a 95 % interval. Points are independent,
    and each has its own random stream: by the seed and the model at the point, so that neither the grid, the order nor
    the number of workers matters. A question without an answer at a point, such as a mean until what may never happen,
    is `none` there and says why. After Ctrl-C the points made so far are returned; see `is_complete`. ValueError:
    names, values and questions that mean nothing.

    >>> model = Model.of(Network.from_text("A + B <-> AB, k, 0.1", k=1.0), {"A": 3, "B": 2})
    >>> found = scan(model, {"k": [0.1, 1.0]}, "E[AB] @ 10")
    >>> found.numbers("value").round(4).tolist()
    [[1.3496], [1.9062]]
    """
    whole, grid = _checked(Model.of(model), over)
    asked = ScanRequest(
        tell_questions(ask),
        whole_number("max_states", max_states, 0),
        truncate,
        whole_number("runs", runs, 2),
        whole_number("seed", seed, 0),
    )
    at_once = 1 if isinstance(workers, str) else whole_number("workers", workers, 1)
    points = list(grid_points(grid))
    check_asked(whole.at(points[0]), asked)
    keys = [asked.key(whole.at(point)) for point in points]
    checkpoints = Checkpoints(folder, asked)
    answers: list[tuple[Answer, ...] | None] = [checkpoints.get(key) for key in keys]
    missing = [number for number, found in enumerate(answers) if found is None]

    def take(number: int, found: Sequence[Answer]) -> None:
        with unbroken():
            checkpoints.add(keys[number], found)
            answers[number] = tuple(found)
        done = sum(each is not None for each in answers)
        if progress is not None:
            progress(f"{done} of {counted(len(points), 'point')}")

    def cost(seconds: Sequence[float], left: int) -> None:
        if left:
            forecast(max(seconds) * left, f"{counted(left, 'point')} like the first ones", at_once)
        if progress is not None and left:
            progress(_cost(seconds, left, len(points), at_once))

    try:
        with executor_of(workers) as executor:
            rest = _first(missing, lambda number: take(number, answers_at(whole, asked, points[number])), cost)
            tasks = [(whole, asked, points[number]) for number in rest]
            for place, found in results(executor, answers_at, tasks):
                take(rest[place], found)
    except KeyboardInterrupt:
        if all(found is None for found in answers):
            raise
    labels = {name: _label(whole, name) for name in grid}
    return Scan(grid, asked.questions, tuple(answers), labels, whole.network.time_unit)


def _checked(model: Model, over: Mapping[str, ArrayLike]) -> tuple[Model, dict[str, Floats]]:
    """The model, and the values of every name, each of which it takes."""
    if over and not isinstance(over, Mapping):
        raise ValueError(f"over = {over!r}; expected a mapping of names to values, as in {{'k1': [1e-3, 1e-2]}}")
    if not over:
        raise ValueError("no name to scan over; give at least one, as in over={'k1': [1e-3, 1e-2]}")
    for name in over:
        if name in RESERVED:
            raise ValueError(f"{name!r} is a column of the table; rename it in the model")
    grid = {name: _values(model, name, values) for name, values in over.items()}
    check_size([len(values) for values in grid.values()])
    first = next(islice(grid_points(grid), 1))
    for name, values in grid.items():
        for value in values.tolist():
            model.at({**first, name: value})  # a formula of a parameter may not take it
    return model, grid


def _values(model: Model, name: str, values: ArrayLike) -> Floats:
    """The values (n,) of a name, as what it stands for allows."""
    found, kind = checked_values(name, values), model.kind(name)
    if kind in (SPECIES, CONSERVED):
        integers(f"counts of {name!r}", found, (None,), minimum=int(kind == CONSERVED))
    elif kind == CHANNEL and found.min() < 0:
        raise ValueError(f"rate constants of {name!r} hold {found.min():g}; expected at least 0")
    return found


def _label(model: Model, name: str) -> str:
    """A title for an axis of a name's values."""
    kind, unit = model.kind(name), inverse(model.network.time_unit)
    if kind == CHANNEL:
        return of_unit(f"rate constant of channel {name}", unit)
    if kind in (SPECIES, CONSERVED):
        return of_unit(f"{name} at time 0", "count")
    channels = [channel for channel, formula in model.network.given.rates.items() if formula.text == name]
    if not channels:
        return f"parameter {name}"  # of a formula, whose unit is not stated
    return of_unit(f"{name}, rate constant of channel{'s' * (len(channels) > 1)} {some_names(channels)}", unit)


def _first(missing: list[int], take: Callable[[int], None], cost: Callable[[Sequence[float], int], None]) -> list[int]:
    """Answer the first point in this process, to report mistakes and the cost at once; returns the points left.

    If it was quick, the second and the last follow: the first also pays for imports, and the last often costs most.
    """
    tried: list[int] = []
    seconds: list[float] = []
    for number in (*missing[:2], *missing[-1:]):
        if number in tried or (seconds and seconds[0] > LONG):
            continue
        began = time.process_time()
        take(number)
        tried.append(number)
        seconds.append(time.process_time() - began)
    left = [number for number in missing if number not in tried]
    cost(seconds[1:] or seconds, len(left))
    return left


def _cost(seconds: Sequence[float], left: int, points: int, workers: int) -> str:
    """A forecast of the CPU time left, from the points answered so far."""
    spread = "" if workers == 1 else f", by {workers} workers in 1/{workers} of that"
    each, rest = _span(seconds, 1), _span(seconds, left)
    return (
        f"{points} points, {left} still to be answered; those tried took {each} of CPU each, so the others take "
        f"{rest}{spread}"
    )


def _span(seconds: Sequence[float], many: int) -> str:
    """From the least to the most, times so many; one figure where they are much the same."""
    low, high = min(seconds) * many, max(seconds) * many
    return span(high) if high <= 1.5 * low else f"{span(low)} to {span(high)}"
