"""Where runs in lockstep stand between calls: one record, as C lays it out, and arrays that look into it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

LANES = 64  # runs side by side, as in the kernels
POINTERS = ("counts", "within", "upto", "change", "starts", "species_of")
# The structure Work of lockstep.c, field by field.
FIELDS = np.dtype(
    [
        ("model", "i8"),
        *((name, "i8") for name in POINTERS),
        *((name, "f8", LANES) for name in ("total", "part", "target", "t", "upcoming")),
        ("words", "u8", (4, LANES)),
        *((name, "i8", LANES) for name in ("run", "seen", "needed", "begun", "looks", "still", "stood", "chosen")),
        ("notes", "i8", 3),
    ]
)


class Lanes:
    """Lanes of runs that have not begun.

    record : for C; arrays : the same memory by name, as `lockstep.LockstepWork` lists it, for Numba and for a look
    """

    def __init__(self, model: Any, changes: NDArray[np.int64]) -> None:
        n_channels, n_species = changes.shape
        change = np.zeros((n_species, n_channels + 1))
        change[:, :n_channels] = changes.T
        channels, species_of = np.nonzero(changes)
        starts = np.searchsorted(channels, np.arange(n_channels + 2))
        tables = (
            np.ones((n_species + 1 + np.count_nonzero(model.terms[:, 3]), LANES)),
            np.empty((n_channels, LANES)),
            np.empty((-(-n_channels // 8), LANES)),
            change,
            starts.astype(np.int64),
            species_of.astype(np.int64),
        )
        self.record = np.zeros(1, FIELDS)
        self.arrays: dict[str, Any] = dict(zip(POINTERS, tables, strict=True))
        for name, table in self.arrays.items():
            self.record[name] = table.ctypes.data
        own = [name for name in FIELDS.names or () if name not in ("model", *POINTERS)]
        self.arrays |= {name: self.record[name][0] for name in own}
