"""Checks of arrays that come from outside: shape, kind and range; the result is read-only."""

from __future__ import annotations

from collections.abc import Mapping
from operator import index
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = TypeVar("Array", bound=NDArray[Any])

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
# Species -> copies, where the others are 0 in a start and open in a condition; or copies (S,) of all species in order.
Counts = Mapping[str, int] | ArrayLike


def integers(name: str, values: ArrayLike, shape: tuple[int | None, ...], minimum: int | None = None) -> Ints:
    """A read-only int64 copy of `values`.

    shape : expected lengths, None if any length will do
    minimum : smallest value allowed
    Whole floats are taken; fractions, NaN and numbers beyond 2**63 - 1 are refused.
    """
    given = _numeric(name, values, shape)
    if given.dtype.kind == "f":
        bad = given[~(np.isfinite(given) & (given == np.rint(given)))]
        if bad.size:
            raise ValueError(f"{name} must be whole numbers; {bad.flat[0]} is not one")
    # 2**63 as a float is just too large for an int64, and numpy would wrap it without a word.
    if given.size and given.dtype.kind != "i" and (given.max() >= 2.0**63 or given.min() < -(2.0**63)):
        raise ValueError(f"{name} holds {given.flat[np.abs(given).argmax()]}; the largest count is 2**63 - 1")
    checked = given.astype(np.int64)
    if minimum is not None and checked.size and checked.min() < minimum:
        raise ValueError(f"{name} holds {checked.min()}; expected at least {minimum}")
    return read_only(checked)


def reals(name: str, values: ArrayLike, shape: tuple[int | None, ...], minimum: float | None = None) -> Floats:
    """A read-only float64 copy of `values`, all finite and none below `minimum`."""
    checked = _numeric(name, values, shape).astype(np.float64)
    bad = checked[~np.isfinite(checked)]
    if bad.size:
        raise ValueError(f"{name} holds {bad.flat[0]}; expected finite numbers")
    if minimum is not None and checked.size and checked.min() < minimum:
        raise ValueError(f"{name} holds {checked.min()}; expected at least {minimum:g}")
    return read_only(checked)


def rising_times(times: ArrayLike, strictly: bool = True) -> Floats:
    """A read-only (T,) array of finite times >= 0 in rising order."""
    checked = reals("times", times, (None,), minimum=0)
    steps = np.diff(checked)
    if np.any(steps <= 0 if strictly else steps < 0):
        where = int(np.argmax(steps <= 0 if strictly else steps < 0))
        raise ValueError(f"times must rise; {checked[where + 1]:g} comes after {checked[where]:g}")
    return checked


def some_times(times: ArrayLike) -> Floats:
    """At least one rising time (T,), not negative. ValueError if there is none."""
    grid = rising_times(times)
    if not grid.size:
        raise ValueError("times is empty; give at least one time")
    return grid


def whole_number(name: str, value: int, least: int) -> int:
    """`value`, a whole number of any type but truth, if it is at least `least`."""
    try:
        number = None if isinstance(value, bool) else index(value)
    except TypeError:
        number = None
    if number is None or number < least:
        raise ValueError(f"{name} = {value!r}; expected a whole number of at least {least}")
    return number


def real_number(name: str, value: float) -> float:
    """`value` if it is one real number, infinite or not."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise ValueError(f"{name} = {value!r}; expected a number")
    return float(value)


def read_only(array: Array) -> Array:
    """The array itself, made read-only."""
    array.setflags(write=False)
    return array


def divided(numbers: ArrayLike, by: ArrayLike, otherwise: float = 0.0) -> Floats:
    """`numbers` over `by` where that is above 0, else `otherwise`; shapes are broadcast."""
    found = np.full(np.broadcast_shapes(np.shape(numbers), np.shape(by)), otherwise)
    np.divide(numbers, by, out=found, where=np.greater(by, 0))
    return found


def _numeric(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[Any]:
    try:
        given = np.array(values)
    except (ValueError, OverflowError) as error:
        raise ValueError(f"{name} is not an array of numbers: {error}") from None
    if given.size == 0:
        given = given.astype(np.int64)
    if given.dtype.kind not in "iufb":
        raise ValueError(f"{name} must be numbers; {str(values)[:80]} came")
    fits = given.ndim == len(shape) and all(
        want in (None, length) for want, length in zip(shape, given.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if length is None else str(length) for length in shape)
        if not given.shape:
            raise ValueError(f"{name} = {given}; expected a list or an array of shape ({wanted})")
        raise ValueError(f"{name} has shape {given.shape}; expected ({wanted})")
    return given
