"""Kernels of linear equations and stationary distributions, in C and by Numba, as those of `twins`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.native.library import call, given, is_built
from kinetics.support.interrupts import short_slices

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def reduce(band: Floats, leaving: Floats, exits: Floats) -> int:
    """Take out the states of a banded chain from the last to the first: `elimination.reduce`."""
    n, width, changes = exits.size, band.shape[1] // 2, 0
    for part in short_slices(n, float(width) ** 2):
        begin, end = n - part.stop, n - part.start
        if is_built():
            changes += call("reduce_band", band, leaving, exits, begin, end, width)
            continue

        changes += kernels.elimination.reduce(band, leaving, exits, begin, end)
    return changes


def solve(band: Floats, exits: Floats, x: Floats) -> None:
    """Reward accumulated until exit: `elimination.solve`."""
    if is_built():
        _divided(call("solve_band", band, exits, x, exits.size, band.shape[1] // 2))
        return

    kernels.elimination.solve(band, exits, x)


def occupy(band: Floats, exits: Floats, x: Floats) -> None:
    """Expected time in each state: `elimination.occupy`."""
    if is_built():
        _divided(call("occupy_band", band, exits, x, exits.size, band.shape[1] // 2))
        return

    kernels.elimination.occupy(band, exits, x)


def balance(band: Floats, x: Floats) -> None:
    """Stationary weights of a banded chain: `elimination.balance`."""
    if is_built():
        call("balance_band", band, x, x.size, band.shape[1] // 2)
        return

    kernels.elimination.balance(band, x)


def balanced(table: Any, exits: Floats, logs: Floats) -> None:
    """A first guess of a stationary distribution, as logarithms (n,): `balance.balanced`.

    table : csr_array of rates
    """
    if is_built():
        begins, columns = given(table.indptr, np.int64), given(table.indices, np.int64)
        rates, out = given(table.data, float), given(exits, float)
        found, queue = np.zeros(logs.size, bool), np.empty(logs.size, np.int64)
        call("balanced", begins, columns, rates, out, logs, found, queue, logs.size)
        return

    kernels.balance.balanced(table.indptr, table.indices, table.data, exits, logs)


def _divided(is_done: int) -> None:
    if not is_done:
        raise ZeroDivisionError("division by zero")


def take_off(
    is_occupation: bool, rows: Ints, columns: Ints, rates: Floats, leaving: Floats, high: Floats, low: Floats,
    left: Floats, sizes: Floats,
) -> None:  # fmt: skip
    """Take a chain's equations at a solution in pairs off the residual: `residuals.occupied`, or `accumulated`."""
    if is_built():
        from_, to = given(rows, np.int64), given(columns, np.int64)
        ways, out = given(rates, float), given(leaving, float)
        name = "occupied" if is_occupation else "accumulated"
        call(name, from_, to, ways, ways.size, out, out.size, high, low, left, sizes)
        return

    (kernels.residuals.occupied if is_occupation else kernels.residuals.accumulated)(
        rows, columns, rates, leaving, high, low, left, sizes
    )


def corrected(high: Floats, low: Floats, change: Floats) -> None:
    """Add a change to pairs: `residuals.corrected`."""
    if is_built():
        call("corrected", high, low, given(change, float), high.size)
        return

    kernels.residuals.corrected(high, low, change)
