"""Where runs in lockstep stand between calls: one record, as C lays it out, and arrays that look into it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

LANES = 64  # runs side by side, as in the kernels
LINE = 64  # bytes of the cache
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
        n_sums, n_blocks = np.count_nonzero(model.terms[:, 3]), -(-n_channels // 8)
        self.record, rows = _together(n_species + 1 + n_sums + n_channels + n_blocks)
        counts, within, upto = np.split(rows, np.cumsum([n_species + 1 + n_sums, n_channels]))
        counts[:] = 1.0
        tables = (counts, within, upto, change, starts.astype(np.int64), species_of.astype(np.int64))
        self.arrays: dict[str, Any] = dict(zip(POINTERS, tables, strict=True))
        for name, table in self.arrays.items():
            self.record[name] = table.ctypes.data
        own = [name for name in FIELDS.names or () if name not in ("model", *POINTERS)]
        self.arrays |= {name: self.record[name][0] for name in own}


def _together(rows: int) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """A record with the rows of lanes right behind it, all from where a line of the cache begins.

    Apart and wherever memory was found, they cost the line of four a tenth of its speed.
    """
    lane_bytes, before = 8 * LANES, 8 * (1 + len(POINTERS))  # all before the first row of the record
    memory = np.zeros(LINE + FIELDS.itemsize + LINE + rows * lane_bytes, np.uint8)
    begin = -(memory.ctypes.data + before) % LINE
    record = memory[begin : begin + FIELDS.itemsize].view(FIELDS)
    behind = begin + FIELDS.itemsize + -(memory.ctypes.data + begin + FIELDS.itemsize) % LINE
    return record, memory[behind : behind + rows * lane_bytes].view(np.float64).reshape(rows, LANES)
