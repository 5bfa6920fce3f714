"""Where runs that are made one after another stand between calls of a kernel; plain Python, for all that read it."""

from typing import NamedTuple

import numpy as np

RUN, PASSED, EVENTS, LOOK = 0, 1, 2, 3  # in `EnsembleWork.notes`
BEFORE = -1  # in place of the events of a run that has not begun


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
    """Before the first run."""
    return EnsembleWork(
        np.ones(n_species + 1, dtype=np.int64), np.zeros(3), np.zeros(4, dtype=np.uint64), np.array([0, 0, BEFORE, 0])
    )
