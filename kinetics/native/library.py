"""The library of C kernels: where it is, and how arrays and structures are passed to it."""

from __future__ import annotations

import ctypes
import functools
from ctypes import POINTER, Structure, byref, c_char, c_double, c_int, c_int32, c_int64, c_uint32, c_uint64, c_void_p
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray


@functools.cache
def library() -> ctypes.CDLL | None:
    """The C kernels, or None where they were not built."""
    try:
        from kinetics.native import _native  # type: ignore[attr-defined]
    except ImportError:
        return None
    loaded = ctypes.CDLL(_native.__file__)
    for name in COUNTING:
        getattr(loaded, name).restype = c_int64
    for name in VOID:
        getattr(loaded, name).restype = None
    return loaded


COUNTING = ("reduce_band", "insert", "packed_spill", "rows_of", "components", "correct_residuals")
VOID = (
    *(
        "tabulate",
        "find",
        "neighbours",
        "reach",
        "advance",
        "mix",
        "absorb",
        "retreat",
        "powers",
        "steps_back",
        "balance_band",
        "balanced",
        "summed_steps",
        "accumulated",
        "occupied",
        "corrected",
        "packed_sources",
        "packed_exits",
        "packed_steps",
    ),
    *("reduce_incomplete", "sweep_solve", "sweep_occupy", "multiply_accumulated", "multiply_occupied"),
    *("lockstep", "extend_range", "fit_bins", "rebin", "tally", "add_products"),
)


def is_built() -> bool:
    """Whether there are C kernels."""
    return library() is not None


class ChannelModel(Structure):
    """`MergedChannels` and what they change, as sampling.h has them."""

    _fields_ = [
        *((name, POINTER(c_double)) for name in ("coefficients", "less", "terms")),
        *((name, POINTER(c_int64)) for name in ("first", "second", "factors")),
        ("is_general", POINTER(c_char)),
        ("changes", POINTER(c_int64)),
        *((name, c_int64) for name in ("n_channels", "n_species", "n_terms", "n_sums", "most_factors", "n_blocks")),
        ("any_general", c_int),
        ("thinning", c_void_p),
    ]


class ThinningTables(Structure):
    """`crowds.Thinning`, as sampling.h has it."""

    _fields_ = [
        *((name, POINTER(c_double)) for name in ("coefficients", "less", "slopes")),
        *((name, POINTER(c_double)) for name in ("weights", "volumes", "factors")),
        *((name, POINTER(c_int64)) for name in ("spans", "partners")),
        ("ratio", c_double),
        ("first", c_int64),
        ("n_powers", c_int64),
    ]


class StopTable(Structure):
    """`ensemble_work.Stop` without its program, as sampling.h has it."""

    _fields_ = [
        ("affects_stop", POINTER(c_char)),
        ("table", POINTER(c_double)),
    ]


class SparseRows(Structure):
    """Rows of a sparse table."""

    _fields_ = [(name, POINTER(c_int64)) for name in ("starts", "species", "copies")]


class HashedStates(Structure):
    """States, their keys, and the hash table of their rows."""

    _fields_ = [
        ("states", POINTER(c_int64)),
        ("keys", POINTER(c_uint64)),
        ("slots", POINTER(c_int64)),
        *((name, c_int64) for name in ("room", "n_slots", "n_species")),
    ]


class StateVerdicts(Structure):
    """What is known of the states of a hash table."""

    _fields_ = [
        ("stops", POINTER(c_char)),
        ("works", POINTER(c_char)),
        ("law_of", POINTER(c_int64)),
        ("n_laws", c_int64),
    ]


class SearchProgress(Structure):
    """Where an exploration stands."""

    _fields_ = [(name, c_int64) for name in ("i", "n", "n_levels", "level_end")]


class ChainMoves(Structure):
    """Moves into each state."""

    _fields_ = [
        *((name, POINTER(c_uint32)) for name in ("begins", "sources")),
        *((name, POINTER(c_double)) for name in ("shares", "exits")),
        ("n", c_int64),
    ]


class RunMoves(Structure):
    """A matrix by runs of rows that are alike."""

    _fields_ = [
        *((name, POINTER(c_int64)) for name in ("firsts", "entries", "offsets", "begins", "pieces")),
        *((name, POINTER(c_double)) for name in ("shares", "stays")),
        *((name, c_int64) for name in ("n_runs", "n", "reach", "is_downwards")),
    ]


class Factored(Structure):
    """Incomplete factors of a chain's equations, and these."""

    _fields_ = [
        *((name, POINTER(c_int32)) for name in ("begins", "middles", "columns")),
        *((name, POINTER(c_double)) for name in ("shares", "reduced", "rates", "exits")),
        ("n", c_int64),
    ]


class PackedChannels(Structure):
    """Channels of states that are packed into one integer each, as packed.c has them."""

    _fields_ = [
        *((name, POINTER(c_int64)) for name in ("shifts", "masks", "starts", "species", "begins", "checked")),
        *((name, POINTER(c_int64)) for name in ("needed", "changes", "offsets", "laws")),
        *((name, POINTER(c_double)) for name in ("less", "moved")),
        *((name, c_int64) for name in ("n_channels", "n_species")),
    ]


TYPES: dict[Any, Any] = {
    POINTER(c_double): float,
    POINTER(c_int64): np.int64,
    POINTER(c_uint64): np.uint64,
    POINTER(c_uint32): np.uint32,
    POINTER(c_int32): np.int32,
    POINTER(c_char): np.bool_,
}


def filled(kind: type[Structure], *values: Any) -> Any:
    """A structure of arrays and numbers; it keeps the arrays, copied where their type or layout is another."""
    made, kept = kind(), []
    for (name, field, *_), value in zip(kind._fields_, values, strict=True):
        if field in TYPES:
            kept.append(np.ascontiguousarray(value, TYPES[field]))
            setattr(made, name, ctypes.cast(kept[-1].ctypes.data, cast(Any, field)))
        else:
            setattr(made, name, value)
    made.kept = kept
    return made


def call(name: str, *arguments: Any) -> Any:
    """Call a C kernel with arrays, whose layout is checked, structures, whole numbers, floats, or None for a null
    pointer; other threads run on."""
    passed: list[Any] = []
    for argument in arguments:
        if isinstance(argument, np.ndarray):
            if not argument.flags.c_contiguous:
                raise ValueError(f"{name}: an array whose items do not lie side by side came")
            passed.append(c_void_p(argument.ctypes.data))
        elif argument is None:
            passed.append(c_void_p(None))
        elif isinstance(argument, float):
            passed.append(c_double(argument))
        else:
            passed.append(byref(argument) if isinstance(argument, Structure) else c_int64(argument))
    return getattr(cast(ctypes.CDLL, library()), name)(*passed)


def given(array: Any, kind: Any) -> NDArray[Any]:
    """An array that is read, of this type and side by side."""
    return np.ascontiguousarray(array, kind)
