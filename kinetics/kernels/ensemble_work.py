"""State of runs between calls of a kernel, and their stop condition; plain Python, importable without Numba."""

from typing import NamedTuple

import numpy as np

RUN, PASSED, EVENTS, LOOK = 0, 1, 2, 3  # in `EnsembleWork.notes`
BEFORE = -1  # in place of the events of a run that has not begun
HOLDS, FAILS = -1, -2  # where a comparison of a `Stop` leads that decides


class EnsembleWork(NamedTuple):
    """The run at hand of an ensemble.

    counts (S + 1,) int64, the last one 1; clock (3,) the time, tu, and what `clock.stands_still` notes;
        stream (4,) uint64 : of the run, see `direct.advance`
    notes (4,) int64 : its place in the ensemble; the times of the grid that it has passed; its events, or BEFORE; and
        the number of events at which it is looked at
    """

    counts: np.ndarray
    clock: np.ndarray
    stream: np.ndarray
    notes: np.ndarray


def ensemble_work(n_species: int) -> EnsembleWork:
    """A workspace before the first run."""
    return EnsembleWork(
        np.ones(n_species + 1, dtype=np.int64), np.zeros(3), np.zeros(4, dtype=np.uint64), np.array([0, 0, BEFORE, 0])
    )


class Stop(NamedTuple):
    """The condition at which runs end: comparisons of sums of counts, each of which leads to another, or decides.

    affects_stop (G + 1,) bool : channels of the kernel that change what the condition reads; the last stands for none
    table (n,) : comparisons one after the other: low, high, yes, no, number of terms, and of each term species and
        weight. If the sum of the terms is from low to high, the comparison that begins at `yes` comes next, else
        that at `no`; or these are HOLDS or FAILS. One array, because each costs a kernel time. Empty for a program
    codes, operands (m,) int32, numbers (m,) : a program in its place, see `programs.Programs`, where the condition
        compares other things than sums; else empty
    """

    affects_stop: np.ndarray
    table: np.ndarray
    codes: np.ndarray
    operands: np.ndarray
    numbers: np.ndarray

    def of_channels(self, channels: np.ndarray) -> "Stop":
        """A copy for a kernel whose channels (G,) are these of the network."""
        return self._replace(affects_stop=np.append(self.affects_stop[channels], False))


def never(n_channels: int) -> Stop:
    """A condition that never holds, for a kernel with G channels: without one, kernels would be compiled once more."""
    nothing = np.empty(0, dtype=np.int32)
    fails = np.array([0.0, 0.0, FAILS, FAILS, 0.0])
    return Stop(np.zeros(n_channels + 1, dtype=np.bool_), fails, nothing, nothing, np.empty(0))
