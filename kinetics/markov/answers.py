"""The distribution of a chain over time, and single runs of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats, Ints, read_only
from kinetics.support.shown import MOST_TIMES, ResultTable, Shown


@dataclass(frozen=True, eq=False, repr=False)
class ChainDistribution(Shown):
    """The probability of every state of a chain at each time, with its error.

    times : (T,) tu
    probabilities : (T, N), none negative
    error : limit on the absolute error summed over all states, at any time
    is_bound : whether `error` is proven; otherwise it is an estimate

    >>> from kinetics import Chain
    >>> found = Chain([[0.0, 0.1], [2.0, 0.0]], initial=0).transient([0.0, 100.0])
    >>> found.probabilities.round(6).tolist(), found.mean([0.0, 1.0]).round(6).tolist(), found.error < 1e-12
    ([[1.0, 0.0], [0.952381, 0.047619]], [0.0, 0.047619], True)
    """

    times: Floats
    probabilities: Floats
    error: float
    is_bound: bool
    method: str
    cpu_seconds: float

    def __post_init__(self) -> None:
        read_only(self.probabilities)

    @property
    def headline(self) -> str:
        """How much it holds, and how it was found."""
        n_times, n_states = self.probabilities.shape
        return (
            f"probabilities of {n_states} states at {n_times} times; method {self.method}; {self.cpu_seconds:.2g} s CPU"
        )

    def summary(self) -> ResultTable:
        """The likeliest states at the last time."""
        last = self.probabilities[-1]
        order = np.argsort(-last, kind="stable")[:MOST_TIMES]
        kind = "proven" if self.is_bound else "estimated"
        notes = [f"error of all probabilities together {self.error:.1g}, {kind}"]
        rows = [(str(row), f"{last[row]:.6g}") for row in order]
        return ResultTable(self.headline, ("state", f"probability at {self.times[-1]:g}"), rows, notes)

    def mean(self, values: ArrayLike) -> Floats:
        """Mean (T,) of values (N,), or means (T, V) of values (N, V); of a mask, its probability."""
        return self.probabilities @ np.asarray(values, dtype=float)

    def mean_bounds(self, values: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper limits of `mean`: at worst all of the error lies between the largest and smallest value."""
        table = np.asarray(values, dtype=float)
        top = np.abs(table).max(axis=0)
        mean = self.mean(table)
        slack = (self.error + 2.0**-52 * len(table)) * top
        return mean - slack, mean + slack


@dataclass(frozen=True, eq=False)
class ChainPath:
    """One run of a chain: its states (n + 1,) and the times (n + 1,), tu, at which it enters them; then until `end`.

    >>> from kinetics import Chain
    >>> path = Chain([[0.0, 1.0], [0.0, 0.0]], initial=0).sample_path(end=1e3, seed=1)
    >>> path.states.tolist(), path.at([0.0, 1e3]).tolist()
    ([0, 1], [0, 1])
    """

    times: Floats
    states: Ints
    end: float

    def at(self, times: ArrayLike) -> Ints:
        """The states (...) at `times` (...), tu."""
        asked = np.asarray(times, dtype=float)
        if asked.size and not (asked.min() >= 0.0 and asked.max() <= self.end):
            raise ValueError(f"times from {asked.min():g} to {asked.max():g} tu; the run is from 0 to {self.end:g} tu")
        return self.states[np.searchsorted(self.times, asked, side="right") - 1]
