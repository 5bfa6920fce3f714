"""Kernels of linear equations and stationary distributions, in C and by Numba, as those of `twins`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.native.library import Factored, call, filled, given, is_built
from kinetics.native.rate_tables import RateTable
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


class Factors(NamedTuple):
    """Equations of a chain by rows, and incomplete factors of them: `incomplete.reduce`.

    begins (n + 1,), middles (n,), columns (K,) : int32; middles : where the entries above the diagonal begin
    shares (K,), reduced (n,) : the factors; rates (K,), exits (n,) : the equations
    record : the same for C, if the C kernels are built
    """

    begins: NDArray[np.int32]
    middles: NDArray[np.int32]
    columns: NDArray[np.int32]
    shares: Floats
    reduced: Floats
    rates: Floats
    exits: Floats
    record: Any

    @classmethod
    def of(cls, table: RateTable, leaving: Floats) -> Factors:
        """Factors of a chain of rates (n, n) without a diagonal, which is left at `leaving` (n,)."""
        n = leaving.size
        begins, columns = table.indptr.astype(np.int32), table.indices.astype(np.int32)
        shares, reduced, left, middles = table.data.copy(), np.empty(n), leaving.astype(float), np.empty(n, np.int32)
        exits = np.add.reduceat(np.append(table.data, 0.0), begins[:-1]) * (np.diff(begins) > 0) + leaving
        if not is_built():
            kernels.incomplete.reduce(begins, columns, shares, left, middles, reduced)
            return cls(begins, middles, columns, shares, reduced, table.data, exits, None)

        places = np.empty(n, np.int32)
        call("reduce_incomplete", begins, columns, shares, left, middles, reduced, n, places)
        arrays = begins, middles, columns, shares, reduced, table.data, exits
        return cls(*arrays, filled(Factored, *arrays, n))

    def product(self, x: Floats, is_occupation: bool) -> Floats:
        """A x (n,), or x A: `incomplete.accumulated`, `occupied`."""
        result = np.empty_like(x)
        if self.record is not None:
            call("multiply_occupied" if is_occupation else "multiply_accumulated", self.record, x, result)
            return result

        kernel = kernels.incomplete.occupied if is_occupation else kernels.incomplete.accumulated
        kernel(self.begins, self.columns, self.rates, self.exits, x, result)
        return result

    def sweep(self, x: Floats, is_occupation: bool) -> None:
        """Solve the equations of the factors, in place: `incomplete.solve`, `occupy`."""
        if self.record is not None:
            call("sweep_occupy" if is_occupation else "sweep_solve", self.record, x)
            return

        kernel = kernels.incomplete.occupy if is_occupation else kernels.incomplete.solve
        kernel(self.begins, self.middles, self.columns, self.shares, self.reduced, x)

    def correct(
        self, is_occupation: bool, units: Floats, left: Floats, change: Floats, goal: float, most: int
    ) -> int:  # fmt: skip
        """Add to a change what takes residuals away; how many rounds that took, at most `most`: `krylov.correct`."""
        n, done = left.size, 0
        memory, numbers, room = np.empty((4, n)), np.empty(3), np.empty((3, n))
        aim, over = np.array([goal]), np.zeros(1, np.int64)
        for part in short_slices(most, 8.0 * (self.shares.size + n)):
            if self.record is not None:
                given_on = is_occupation, units, left, change, aim, memory, numbers, room, done, part.stop, over
                done = call("correct_residuals", self.record, *given_on)
            else:
                done, over[0] = kernels.krylov.correct(
                    *self[:7], is_occupation, units, left, change, goal, memory, numbers, done, part.stop
                )
            if over[0]:
                break
        return done


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
