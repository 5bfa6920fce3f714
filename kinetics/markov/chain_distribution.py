"""The distribution of a chain over its states at several times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.answer import kind_of
from kinetics.support.arrays import Floats, read_only
from kinetics.support.shown import MOST_TIMES, ResultTable, Shown


@dataclass(frozen=True, eq=False, repr=False)
class ChainDistribution(Shown):
    """The probability of every state of a chain at each time, with its error.

    times : (T,) tu
    probabilities : (T, N), none negative
    error : bound on the absolute error summed over all states, at any time
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
        """One line: the numbers of states and times, the method and the CPU time."""
        n_times, n_states = self.probabilities.shape
        return (
            f"probabilities of {n_states} states at {n_times} times; method {self.method}; {self.cpu_seconds:.2g} s CPU"
        )

    def summary(self) -> ResultTable:
        """The likeliest states at the last time."""
        last = self.probabilities[-1]
        order = np.argsort(-last, kind="stable")[:MOST_TIMES]
        notes = [f"error of all probabilities together {self.error:.1g}, {kind_of(self.is_bound)}"]
        rows = [(str(row), f"{last[row]:.6g}") for row in order]
        return ResultTable(self.headline, ("state", f"probability at {self.times[-1]:g}"), rows, notes)

    def mean(self, values: ArrayLike) -> Floats:
        """Mean (T,) of values (N,), or means (T, V) of values (N, V); of a mask, its probability."""
        return self.probabilities @ np.asarray(values, dtype=np.float64)

    def mean_bounds(self, values: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper bounds of `mean`: at worst all of the error lies between the largest and smallest value."""
        table = np.asarray(values, dtype=float)
        top = np.abs(table).max(axis=0)
        mean = self.mean(table)
        slack = (self.error + 2.0**-52 * len(table)) * top
        return mean - slack, mean + slack
