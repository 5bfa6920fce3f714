"""Means of values of the state at one time: backwards where the steps are few, else forwards by a solving method."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.backward import expected_at, steps_until, that_matter
from kinetics.markov.transient import ListingMethod, StateSpace, Transient, Transitions
from kinetics.markov.transient.dense import MAX_DENSE
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.uniformisation import MAX_STEPS
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats, real_number, rising_times
from kinetics.support.cli.progress import allowed
from kinetics.support.tables import counted

BACKWARD = "uniformisation, backwards"
MANY_STEPS = 1_000_000  # of a pass backwards; more take longer than to solve a small chain forwards by squaring


def one_time(name: str, given: float) -> float:
    """Check one time, tu: finite and at least 0, else a ValueError."""
    return float(rising_times([real_number(name, given)])[0])


def stopped_in(space: StateSpace | None, stops: NDArray[np.bool_]) -> StateSpace | None:
    """The states of a network behind a chain that is stopped in some (N,)."""
    return None if space is None else replace(space, is_stopped=space.is_stopped | stops)


def steps_to(transitions: Transitions, start: Floats, values: Floats, end: float, enough: float = 0.0) -> float:
    """Steps of a pass backwards until a time, tu; only if they are more than `enough`, of the states that matter."""
    steps = steps_until(transitions, end)
    return steps if steps <= enough else steps_until(that_matter(transitions, start, values)[0], end)


def mean_at(
    transitions: Transitions,
    start: Floats,
    values: Floats,
    end: float,
    space: StateSpace | None = None,
    method: ListingMethod | None = None,
) -> Answer:
    """Mean of `values` (N,), none negative, at a time, tu, with bounds.

    method : a solving method for the pass, forwards, whose error is absolute; by default it is backwards, with a
        relative one, or by `Transient` where that would take too many steps
    """
    size = counted(transitions.size, "state")
    began, most = time.process_time(), MANY_STEPS if transitions.size <= MAX_DENSE else MAX_STEPS
    if method is None and steps_to(transitions, start, values, end, most) <= most:
        found = expected_at(transitions, start, values, end)
        return replace(found, method=BACKWARD, cpu_seconds=time.process_time() - began, why=size)
    chosen = method or Transient(max_seconds=allowed(Transient.max_seconds))
    rows, error, is_bound = chosen.probabilities(transitions, start, np.array([end]), space)
    value = float(rows[0] @ values)
    slack = 1.001 * (error + ROUNDOFF * transitions.size) * float(values.max())
    seconds = time.process_time() - began
    return Answer(value, max(value - slack, 0.0), value + slack, kind_of(is_bound), chosen.name, seconds, size)
