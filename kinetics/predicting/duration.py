"""A duration for a prediction that was given none, from the rate equations: until they settle."""

from __future__ import annotations

from math import floor, inf, log10
from typing import Any, NamedTuple

import numpy as np

from kinetics.network import Model
from kinetics.predicting.rate_equations import RateEquations
from kinetics.support.arrays import Floats
from kinetics.support.tables import in_unit

MOST_SPECIES = 300  # whose equations are integrated, as for `Outlook`
MOST_EVALUATIONS = 50_000  # some seconds; a number, so that the choice does not depend on the machine
MOST_EVENTS = 1e5  # of a run until the time chosen, or `EVENTS_PER_COPY` times the largest count
EVENTS_PER_COPY = 10.0
FAR = 1e12  # times the mean wait for the first event: what is slower is not looked for
NEAR = 0.01  # of the range of a species, within which it has settled
SEEN = 0.5  # copies: a smaller range is no relevant one, unless all are
GROWTH, FEW = 10.0, 10.0  # times the largest count at the start, or so many copies, that unbounded growth is shown to
PERIODS, RELAXATIONS = 10, 5.0  # of a cycle, and of a start at rest


class ChosenDuration(NamedTuple):
    """A duration, tu or the model's unit of time, and why this one."""

    value: float
    why: str


class _Course(NamedTuple):
    """The rate equations from the start: times (n,), counts (n, S), events of a run until then (n,).

    fault : why they were not followed to the end; "" if they were
    """

    times: Floats
    counts: Floats
    events: Floats
    fault: str


def chosen_duration(model: Model, otherwise: float) -> ChosenDuration:
    """A duration of 1, 2 or 5 times a power of ten that shows what a model does, from its rate equations.

    It is the time by which every species is within 1 % of its range from its final count; for growth without bound the
    time of a tenfold count, for a cycle ten periods, for a start at rest five times the slowest relaxation of the
    linearised equations. It is less if a run had more than 1e5 events until then, and `otherwise` if the rate equations
    say nothing: events, laws that jump or depend on the time, nothing that can happen.
    Cost: up to 50,000 evaluations of the propensities, mostly some hundreds.

    >>> from kinetics import Model, Network
    >>> from kinetics.predicting.duration import chosen_duration
    >>> chosen_duration(Model(Network.from_text("A -> B, 0.1"), {"A": 100}), 2000.0)
    ChosenDuration(value=50.0, why='rate equations settle by 46.4')
    """
    network, unit = model.network, model.network.time_unit
    if len(network.species) > MOST_SPECIES:
        return ChosenDuration(otherwise, f"default, as over {MOST_SPECIES} species are too many for rate equations")
    try:
        equations = RateEquations(network)
    except ValueError as refusal:
        return ChosenDuration(otherwise, f"default, as {str(refusal).split(';')[0]}")
    total = float(equations.rates(0.0, model.initial.astype(float)).sum())
    if equations.reads_time or not 0.0 < total < inf:
        why = "a law depends on the time" if equations.reads_time else "nothing can happen at the start"
        return ChosenDuration(otherwise, f"default, as {why}")
    course = _followed(equations, model.initial.astype(float), total)
    value, why, is_up = _shown(equations, course, unit)
    is_known = 0.0 < value < inf
    seen = course.counts if not is_known else course.counts[course.times <= value]
    most = max(MOST_EVENTS, EVENTS_PER_COPY * float(seen.max()))
    if not is_known and not course.events[-1] > most:
        why = course.fault or "rate equations neither settle, grow nor cycle"
        return ChosenDuration(otherwise, f"default, as {why}")
    chosen = rounded(value, is_up) if is_known else inf
    if np.interp(chosen, course.times, course.events) > most:
        chosen = rounded(float(np.interp(most, course.events, course.times)), is_up=False)
        why = f"a run has {most:.2g} events by then; {why or 'rate equations have not settled'}"
    return ChosenDuration(chosen, why)


def rounded(value: float, is_up: bool) -> float:
    """The next number of 1, 2 or 5 times a power of ten.

    >>> rounded(4.6, True), rounded(4.6, False), rounded(1e-3, True)
    (5.0, 2.0, 0.001)
    """
    power = floor(log10(value))
    steps = [float(f"{digit}e{power + more}") for more in (-1, 0, 1) for digit in (1, 2, 5)]
    slack = 1e-9 * value
    if is_up:
        return min(step for step in steps if step >= value - slack)
    return max(step for step in steps if step <= value + slack)


def _followed(equations: RateEquations, start: Floats, total: float) -> _Course:
    """The rate equations as far as they can be followed."""
    times, counts, events, rate, fault = [0.0], [start], [0.0], total, ""
    try:
        for solver in equations.steps(start, FAR / total, inf):
            before, rate = rate, float(equations.rates(solver.t, solver.y).sum())
            events.append(events[-1] + 0.5 * (before + rate) * (solver.t - times[-1]))
            times.append(float(solver.t))
            counts.append(np.array(solver.y))
            if solver.nfev > MOST_EVALUATIONS:
                fault = f"rate equations have not settled after {MOST_EVALUATIONS} evaluations"
                break
    except ValueError as error:
        fault = str(error).split(";")[0]
    return _Course(np.array(times), np.array(counts), np.array(events), fault)


def _shown(equations: RateEquations, course: _Course, unit: str) -> tuple[float, str, bool]:
    """A time that shows what happens, why, and whether more is better; 0 if none is known."""
    times, counts = course.times, course.counts
    ranges = np.ptp(counts, axis=0)
    top = float(ranges.max())
    late = counts[times >= times[-1] / 10]
    if not course.fault and np.all(np.ptp(late, axis=0) <= 1e-3 * np.maximum(top, 1e-6)):
        relevant = (ranges >= SEEN) | (ranges >= NEAR * top)
        away = np.abs(counts - counts[-1])[:, relevant] > NEAR * ranges[relevant]
        moving = np.flatnonzero(away.any(axis=1))
        if top > 1e-6 * max(1.0, float(counts.max())) and moving.size:
            settled = float(times[min(moving[-1] + 1, times.size - 1)])
            return settled, f"rate equations settle by {in_unit(f'{settled:.3g}', unit)}", True
        slowest = _relaxation(equations, counts[0])
        why = f"the start is at rest; the slowest relaxation takes {in_unit(f'{slowest:.3g}', unit)}"
        return RELAXATIONS * slowest, why, True
    most = counts.max(axis=1)
    shown = GROWTH * max(FEW, float(most[0]))
    if most[-1] >= max(1e3 * shown, 0.5 * float(most.max())):
        grown = float(np.interp(shown, np.maximum.accumulate(most), times))
        return grown, f"counts grow without bound, to {shown:g} copies at {in_unit(f'{grown:.3g}', unit)}", False
    widest = counts[:, int(ranges.argmax())]
    is_high = widest > 0.5 * (widest.min() + widest.max())  # of a cycle, not of noise about rest
    rises = times[1:][is_high[1:] & ~is_high[:-1]]
    if rises.size < 3:
        return 0.0, "", True
    period = float(np.median(np.diff(rises)))
    return PERIODS * period, f"rate equations cycle with a period of about {in_unit(f'{period:.3g}', unit)}", True


def _relaxation(equations: RateEquations, x: Floats) -> float:
    """The slowest relaxation time of the equations linearised at counts (S,), tu; 0 if there is none."""
    size = 1e-6 * np.maximum(x, 1.0)
    columns: list[Any] = [equations.slope(0.0, x + step) - equations.slope(0.0, x) for step in np.diag(size)]
    speeds = np.abs(np.linalg.eigvals(np.array(columns).T / size).real)
    speeds = speeds[speeds > 1e-6 * speeds.max(initial=0.0)]
    return 1.0 / float(speeds.min()) if speeds.size else 0.0
