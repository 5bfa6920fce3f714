"""Steps of chains whose states are packed into one integer each: in C, else by `kernels.packed`; on two threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.native.library import PackedChannels, call, filled, is_built
from kinetics.support.interrupts import short_slices

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Places = NDArray[np.int32]
Mask = NDArray[np.bool_]
Bits = NDArray[np.uint64]  # a word for every 64 channels
ROWS = 128  # as in packed.c; threads share rows at multiples of it
SHARED = 200_000  # rows times channels, from which on two threads are quicker than one


class ChannelArrays(NamedTuple):
    """Channels of packed states, as packed.c describes them."""

    shifts: Ints
    masks: Ints
    starts: Ints
    species: Ints
    begins: Ints
    checked: Ints
    needed: Ints
    changes: Ints
    offsets: Ints
    laws: Ints
    less: Floats
    moved: Floats

    def record(self) -> Any:
        """The channels as a kernel takes them, made once for many calls."""
        return filled(PackedChannels, *self, self.offsets.size, self.shifts.size) if is_built() else self


def sources(record: Any, keys: Ints, is_stopped: Mask, table: Floats, pool: ThreadPoolExecutor) -> tuple[Places, Bits]:
    """Rows (R, N) from which the channels lead to each state, N for none, and the bits (N, W) of channels that lead
    from a state to one of these: `packed.sources`."""
    n, n_channels = keys.size, _channels(record).offsets.size
    found, inside = np.empty((n_channels, n), np.int32), _no_bits(n, n_channels)
    is_shared = n * n_channels > SHARED
    others = _no_bits(n, n_channels) if is_shared else inside

    def part(first: int, last: int, bits: Bits) -> None:
        for some in short_slices(last - first, 4.0 * n):
            begin, end = first + some.start, first + some.stop
            if is_built():
                given = keys, n, is_stopped, table
                call("packed_sources", record, begin, end, *given, found, bits, bits.shape[1])
                continue

            kernels.packed.sources(record, begin, end, keys, is_stopped, table, found, bits)

    middle = n_channels // 2 if is_shared else n_channels
    _both(pool, lambda: part(0, middle, inside), lambda: part(middle, n_channels, others), is_shared)
    return found, inside | others if is_shared else inside


def exits(record: Any, coefficients: Floats, keys: Ints, is_stopped: Mask, table: Floats) -> tuple[Floats, Bits]:
    """Sums (N,) of all propensities, and the bits (N, W) of those above 0: `packed.exits`."""
    n = keys.size
    totals, able = np.empty(n), _no_bits(n, coefficients.size)
    for some in short_slices(n, 4.0 * coefficients.size):
        if is_built():
            rows = keys, some.start, some.stop, n, is_stopped, table
            call("packed_exits", record, coefficients, *rows, totals, able, able.shape[1])
            continue

        kernels.packed.exits(record, coefficients, keys, some.start, some.stop, is_stopped, table, totals, able)
    return totals, able


def spill(
    record: Any, coefficients: Floats, start: Ints, vector: Floats, leaving: Floats, leads: Bits, table: Floats,
    floor: float, keys: Ints,
) -> tuple[Ints, Floats] | None:  # fmt: skip
    """Keys and flows of what leads out of `keys`, one by one; None if a key has no room for a count: `packed.spill`."""
    room = 4 * start.size + 64
    while True:
        ends, flows = np.empty(room, np.int64), np.empty(room)
        if is_built():
            bits, number = (leads, leads.shape[1]), (keys, keys.size)
            rows = start, vector, leaving, *bits, start.size, table, float(floor), *number
            found = int(call("packed_spill", record, coefficients, *rows, ends, flows, room))
        else:
            given = start, vector, leaving, leads, table, floor, keys
            found = int(kernels.packed.spill(record, coefficients, *given, ends, flows))
        if found < 0:
            return None
        if found <= room:
            return ends[:found], flows[:found]
        room = found


class PackedSteps(NamedTuple):
    """What steps of a set of states take; `kernels.packed.steps` says what each is."""

    record: Any
    coefficients: Floats
    keys: Ints
    sources: Places
    exits: Floats
    table: Floats

    def run(
        self, weights: Floats, tails: Floats, first: int, n_steps: int, vector: Floats, other: Floats, sums: Floats,
        events: Floats, pool: ThreadPoolExecutor,
    ) -> tuple[Floats, Floats]:  # fmt: skip
        """Steps first to before first + n_steps; the vector after these, and room for another. Ctrl-C is heard."""
        n, work = self.keys.size, 2.0 * self.keys.size * (self.coefficients.size + 4)

        def go(begin: int, end: int, step: int, count: int, now: Floats, after: Floats) -> None:
            if is_built():
                call(
                    "packed_steps", *self, n, begin, end, weights, tails, *weights.shape, step, count, now, after, sums,
                    events,
                )  # fmt: skip
                return

            kernels.packed.steps(*self, begin, end, weights, tails, step, count, now, after, sums, events)

        if n * self.coefficients.size <= SHARED:
            for part in short_slices(n_steps, work):
                count = part.stop - part.start
                go(0, n, first + part.start, count, vector, other)
                if count == 1:
                    vector, other = other, vector
            return vector, other
        middle = n // (2 * ROWS) * ROWS
        for step in range(first, first + n_steps):

            def half(begin: int, end: int, step: int = step, now: Floats = vector, after: Floats = other) -> None:
                go(begin, end, step, 1, now, after)

            _both(pool, lambda: half(0, middle), lambda: half(middle, n), True)
            vector, other = other, vector
        return vector, other


def _no_bits(n: int, n_channels: int) -> Bits:
    return np.zeros((n, max(1, -(-n_channels // 64))), np.uint64)


def _channels(record: Any) -> Any:
    return ChannelArrays(*record.kept) if isinstance(record, PackedChannels) else record


def _both(pool: ThreadPoolExecutor, one: Callable[[], None], other: Callable[[], None], is_shared: bool) -> None:
    """Do both at once; at Ctrl-C the other is waited for, since it writes to arrays of ours."""
    if not is_shared:
        one()
        return
    begun = pool.submit(other)
    try:
        one()
    finally:
        begun.result()
