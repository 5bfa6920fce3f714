"""Kernels that exist twice: in C, where nothing is compiled at run time, and by Numba, their oracle and fallback.

The C code gives the same bits: the same arithmetic in the same order, without fused multiply-adds. What a command
needs that samples or solves an ordinary network is here, so that it starts without Numba. Each function has the
arguments and results of its twin in Python, named in its note, which runs where the C library was not built.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.kernels.ensemble_work import EnsembleWork, Stop
from kinetics.native.lanes import Lanes
from kinetics.native.library import (
    ChainMoves,
    ChannelModel,
    RunMoves,
    StopTable,
    ThinningTables,
    call,
    filled,
    given,
    is_built,
)
from kinetics.support.interrupts import short_slices

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Stopping = tuple[Stop, Floats]  # the condition at which runs end, and when it first held in each

CACHE_BYTES = 2**20  # that steps which follow each other take at a time
MOST_TOGETHER = 16  # of these steps
PIECE = 256  # rows that a step does at a time: ROWS in chains.c
BLOCK = 8  # channels, whose propensities are summed by themselves


def direct(
    model: Any, changes: Ints, work: EnsembleWork, initial: Ints, grid: Floats, key: Words, first_run: int, out: Ints,
    stopping: Stopping,
) -> Callable[[Ints, int], int]:  # fmt: skip
    """What goes on with many runs by the direct method, one by one, given limits and the most events of a call:
    `direct.ensemble`."""
    stop, reached = stopping
    if not is_built() or _has_program(stop):
        return lambda limits, most: kernels.direct.ensemble(
            model, changes, work, initial, grid, key, first_run, limits, out, most, stop, reached
        )
    chain, times, table = _model(model, changes), given(grid, float), _table(stop)
    begun = chain, *work, given(initial, np.int64), times, times.size, given(key, np.uint64), first_run
    return lambda limits, most: _sampled(call("direct", *begun, limits, len(out), out, most, table, reached), changes)


def lockstep(
    model: Any, changes: Ints, lanes: Lanes, initial: Ints, grid: Floats, key: Words, first_run: int, out: Ints,
    is_odd: NDArray[np.bool_], stopping: Stopping,
) -> Callable[[Ints, int], None]:  # fmt: skip
    """What goes on with many runs, 64 side by side, given limits and the most events of a call:
    `lockstep.lockstep`."""
    stop, reached = stopping
    if not is_built() or _has_program(stop):
        work = kernels.lockstep.LockstepWork(**lanes.arrays)
        return lambda limits, most: kernels.lockstep.lockstep(
            model, changes, work, initial, grid, key, first_run, limits, out, is_odd, most, stop, reached
        )
    chain, times, table = _model(model, changes), given(grid, float), _table(stop)
    begun = chain, lanes.record, given(initial, np.int64), times, times.size, given(key, np.uint64), first_run
    return lambda limits, most: call("lockstep", *begun, limits, len(out), out, is_odd, most, table, reached)


def _sampled(outcome: int, changes: Ints) -> int:
    if outcome < 0:
        raise MemoryError(f"no memory to sample {len(changes)} channels")
    return outcome


class _Last(threading.local):
    """The model that a thread has passed to C last: runs go on with it, call after call."""

    given: tuple[Any, Any] = (None, None)
    made: Any = None


_last = _Last()


def _model(model: Any, changes: Ints) -> Any:
    if _last.given[0] is model and _last.given[1] is changes:
        return _last.made
    (n_channels, n_species), thinning = changes.shape, _thinning(model.thinning)
    _last.made = filled(
        ChannelModel, model.coefficients, model.less, model.terms, model.first, model.second, model.factors,
        model.is_general, changes, n_channels, n_species, len(model.terms), np.count_nonzero(model.terms[:, 3]),
        model.factors.shape[1], -(-n_channels // BLOCK), int(np.any(model.is_general)),
        None if thinning is None else ctypes.addressof(thinning),
    )  # fmt: skip
    _last.made.kept.append(thinning)
    _last.given = model, changes
    return _last.made


def _thinning(thinning: Any) -> Any:
    if thinning is None:
        return None
    tables = thinning.coefficients, thinning.less, thinning.slopes, thinning.weights, thinning.volumes, thinning.factors
    numbers = thinning.ratio, thinning.first, thinning.factors.shape[1]
    return filled(ThinningTables, *tables, thinning.spans, thinning.partners, *numbers)


def _has_program(stop: Stop) -> bool:
    """Whether the condition needs the machine that runs programs, of which there is none in C."""
    return stop.codes.size > 0


def _table(stop: Stop) -> Any:
    return filled(StopTable, stop.affects_stop, stop.table) if stop.affects_stop.any() else None


def events(
    model: Any, changes: Ints, counts: Ints, clock: Floats, end: float, stream: Words, times: Floats, fired: Ints,
    stop: Stop,
) -> tuple[int, int]:  # fmt: skip
    """Run one trajectory on until `end`, or until the buffers of events are full: `direct.advance`."""
    if not is_built() or _has_program(stop):
        outcome, n = kernels.direct.advance(model, changes, counts, clock, end, stream, times, fired, stop)
        return outcome, n
    last, n_events = np.array([end], dtype=float), np.zeros(1, np.int64)
    outcome = call(
        "events", _model(model, changes), counts, clock, last, stream, times, fired, times.size, n_events, _table(stop)
    )
    return _sampled(outcome, changes), int(n_events[0])


def extend_range(counts: Ints, low: Ints, high: Ints) -> None:
    """Widen ranges to hold the counts: `statistics.extend_range`."""
    if is_built():
        call("extend_range", counts, len(counts), low.size, low, high)
        return

    kernels.statistics.extend_range(counts, low, high)


def fit_bins(low: Ints, high: Ints, n_bins: int, shift: Ints, origin: Ints) -> None:
    """Narrowest bins that hold low to high: `statistics.fit_bins`."""
    if is_built():
        call("fit_bins", low, high, low.size, n_bins, shift, origin)
        return

    kernels.statistics.fit_bins(low, high, n_bins, shift, origin)


def rebin(histogram: Ints, shift: Ints, origin: Ints, new_shift: Ints, new_origin: Ints) -> None:
    """Put histograms into wider or moved bins: `statistics.rebin`."""
    if is_built():
        n_bins = histogram.shape[2]
        row = np.empty(n_bins, np.int64)
        call("rebin", histogram, shift.size, n_bins, shift, origin, new_shift, new_origin, row)
        return

    kernels.statistics.rebin(histogram, shift, origin, new_shift, new_origin)


def tally(counts: Ints, shift: Ints, origin: Ints, histogram: Ints) -> None:
    """Count every value in its bin: `statistics.tally`."""
    if is_built():
        call("tally", counts, len(counts), shift.size, histogram.shape[2], shift, origin, histogram)
        return

    kernels.statistics.tally(counts, shift, origin, histogram)


def add_products(counts: Ints, reference: Ints, first: Ints, second: Ints, sums: Ints, products: Ints) -> None:
    """Add deviations from a reference, and their products: `statistics.add_products`, `add_squares`."""
    if is_built():
        runs, n_times, n_species = counts.shape
        off, one, other = np.empty(n_species, np.int64), given(first, np.int64), given(second, np.int64)
        call(
            "add_products", counts, runs, n_times, n_species, given(reference, np.int64), one, other, one.size,
            sums, products, off,
        )  # fmt: skip
        return

    if np.array_equal(first, second):
        kernels.statistics.add_squares(counts, reference, sums, products)
    else:
        kernels.statistics.add_products(counts, reference, first, second, sums, products)


def advance(
    begins: NDArray[np.uint32], sources: NDArray[np.uint32], shares: Floats, exits: Floats, vectors: Floats,
    flows: Floats,
) -> None:  # fmt: skip
    """ChainMoves of a uniformised chain: `markov.advance`."""
    moves = filled(ChainMoves, begins, sources, shares, exits, exits.size) if is_built() else None
    for part in short_slices(flows.size, shares.size + exits.size):
        some, out = vectors[part.start : part.stop + 1], flows[part]
        if moves is not None:
            call("advance", moves, some, out, out.size)
            continue

        kernels.markov.advance(begins, sources, shares, exits, some, out)


def mix(rows: Ints, weights: Floats, vectors: Floats, mixed: Floats) -> None:
    """Add sums of weighted vectors to rows: `markov.mix`."""
    places, factors = given(rows, np.int64), given(weights, float)
    for part in short_slices(places.size, vectors.size):
        if is_built():
            some, by = places[part], factors[part]
            call("mix", some, by, some.size, by.shape[1], vectors, vectors.shape[1], mixed)
            continue

        kernels.markov.mix(places[part], factors[part], vectors, mixed)


def absorb(
    begins: NDArray[np.uint32], sources: NDArray[np.uint32], shares: Floats, exits: Floats, vector: Floats,
    absorbed: Floats, alive: Floats, flows: Floats,
) -> None:  # fmt: skip
    """ChainMoves of a chain whose last state is never left: `markov.absorb`."""
    moves = filled(ChainMoves, begins, sources, shares, exits, exits.size) if is_built() else None
    for part in short_slices(flows.size, shares.size + exits.size):
        if moves is not None:
            out = absorbed[part], alive[part], flows[part]
            call("absorb", moves, vector, np.empty_like(vector), *out, out[0].size)
            continue

        kernels.markov.absorb(begins, sources, shares, exits, vector, absorbed[part], alive[part], flows[part])


def backward_moves(begins: NDArray[np.uint32], targets: NDArray[np.uint32], shares: Floats, stays: Floats) -> Any:
    """Moves out of each state and what stays, as `retreat` takes them; made once for many calls."""
    moves = begins, targets, shares, stays
    return filled(ChainMoves, *moves, stays.size) if is_built() else moves


def retreat(moves: Any, starts: Ints, chances: Floats, now: Floats, before: Floats, means: Floats) -> None:
    """Steps backwards, with a mean before each: `markov.retreat`; moves : of `backward_moves`."""
    first, weights = given(starts, np.int64), given(chances, float)
    is_native = isinstance(moves, ChainMoves)
    n_moves = (moves.kept if is_native else moves)[2].size
    for part in short_slices(means.size, 2.0 * (n_moves + now.size)):
        out = means[part]
        if is_native:
            call("retreat", moves, first, weights, first.size, now, before, out, out.size)
            continue

        kernels.markov.retreat(*moves, first, weights, now, before, out)


def powers(moves: Any, vectors: Floats) -> None:
    """Fill the rows of `vectors` (B + 1, N) after the first: `markov.powers`.

    moves : of `backward_moves`, but into states
    """
    is_native = isinstance(moves, ChainMoves)
    n_moves = (moves.kept if is_native else moves)[2].size
    for part in short_slices(len(vectors) - 1, 2.0 * (n_moves + vectors.shape[1])):
        some = vectors[part.start : part.stop + 1]
        if is_native:
            call("powers", moves, some, len(some) - 1)
            continue

        kernels.markov.powers(*moves, some)


def steps_back(
    moves: Any, vectors: Floats, weights: Floats, after: Floats, values: Floats, later: Floats, gained: Floats,
    held: Floats, mixed: Floats,
) -> None:  # fmt: skip
    """Step backwards, and note what each move brings: `markov.steps_back`; moves : of `backward_moves`."""
    is_native, values = isinstance(moves, ChainMoves), given(values, float)
    for part in reversed(list(short_slices(len(vectors), 2.0 * (gained.size + values.size)))):
        some = vectors[part], weights[part], after[part]
        if is_native:
            room = np.empty_like(later)
            call("steps_back", moves, *some, values, later, room, gained, held, mixed, weights[part].size)
            continue

        kernels.markov.steps_back(*moves, *some, values, later, gained, held, mixed)


def summed_steps(matrix: Any, diagonal: Floats, weights: Floats, vector: Floats) -> Floats:
    """Sums (T, N) of weights[t, b] v over steps v <- M v, from a vector (N,): `markov.summed_steps`.

    matrix : csr_array (N, N), M off its diagonal (N,); weights : (T, B)
    """
    sums, n_steps = np.zeros((len(weights), diagonal.size)), weights.shape[1]
    parts = short_slices(n_steps, 2.0 * (matrix.nnz + diagonal.size))
    if not is_built():
        places, now = (matrix.indptr.astype(np.uint32), matrix.indices.astype(np.uint32)), vector.copy()
        for part in parts:
            some = np.ascontiguousarray(weights[:, part])
            kernels.markov.summed_steps(*places, matrix.data, diagonal, some, now, sums)
        return sums

    moves = run_moves(matrix, diagonal)
    # of the rows between a step and the one after it: entries, the diagonal, two vectors and a sum
    row_bytes = 8.0 * (matrix.nnz / diagonal.size + 4.0)
    together = int(np.clip(CACHE_BYTES / (row_bytes * (moves.reach + 512.0)), 1, MOST_TOGETHER))
    vectors = np.empty((together + 1, diagonal.size))
    vectors[0] = vector
    for part in parts:
        some = np.ascontiguousarray(weights[:, part])
        call("summed_steps", moves, some, *some.shape, together, vectors, sums)
    return sums


def run_moves(matrix: Any, diagonal: Floats) -> Any:
    """A csr_array (N, N) by runs of rows whose entries are in the same places next to the diagonal (N,)."""
    n, begins = diagonal.size, matrix.indptr.astype(np.int64)
    counts = np.diff(begins)
    rows = np.repeat(np.arange(n), counts)
    offsets, which = matrix.indices - rows, np.arange(rows.size) - begins[rows]
    is_first = np.append(True, counts[1:] != counts[:-1])
    before = np.maximum(begins[rows - 1] + which, 0)
    same = is_first[rows] | (offsets[np.minimum(before, max(rows.size - 1, 0))] == offsets)
    is_first[rows[~same]] = True
    firsts = np.flatnonzero(is_first)
    run = np.cumsum(is_first) - 1
    lengths = np.diff(np.append(firsts, n))
    there = run[rows]
    shares = np.empty(matrix.nnz)
    shares[begins[firsts[there]] + which * lengths[there] + (rows - firsts[there])] = matrix.data
    entries = np.append(0, np.cumsum(counts[firsts]))
    up, down = int(offsets.max(initial=0)), -int(offsets.min(initial=0))
    places = np.append(firsts, n), entries, offsets[is_first[rows]], begins[firsts], run[::PIECE]
    return filled(RunMoves, *places, shares, diagonal, firsts.size, n, min(up, down), int(down < up))


def reach(begins: Ints, ends: Ints, queue: Ints, n_queued: int, is_found: NDArray[np.bool_]) -> None:
    """Mark all states to which some way leads: `exploration.reach`."""
    if is_built():
        call("reach", begins, ends, queue, n_queued, is_found)
        return

    kernels.exploration.reach(begins, ends, queue, n_queued, is_found)
