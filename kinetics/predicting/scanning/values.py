"""The values that a scanned name takes: as text, `1,2,5` or `1e-4:1e-2:20log`, and checked."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats, reals

MOST_POINTS = 100_000
RANGE = re.compile(r"([^:]+):([^:]+):\s*(\d+)\s*(lin|log)?\s*")
FORMS = "expected NAME=a,b,c or NAME=low:high:n, with `log` or `lin` behind n, as in k1=1e-4:1e-2:20log"


def read_values(text: str) -> tuple[str, Floats]:
    """The name and values of `k1=1e-4:1e-2:20log` or `cubes=20,40,60`; a range includes both of its ends.

    >>> read_values("cubes=20:60:3")
    ('cubes', array([20., 40., 60.]))
    """
    name, equals, given = (part.strip() for part in text.rpartition("="))
    if not (equals and name and given):
        raise ValueError(f"{text!r} names no values; {FORMS}")
    if ":" not in given:
        return name, checked_values(name, [_number(part, text) for part in given.split(",")])
    found = RANGE.fullmatch(given)
    if not found:
        raise ValueError(f"{text!r} is no range; {FORMS}")
    low, high, n = _number(found[1], text), _number(found[2], text), _count(found[3], text)
    if n == 1 and low != high:
        raise ValueError(f"{text!r} is a range of one value with two different ends; give 2 values or more")
    if found[4] != "log":
        return name, checked_values(name, np.linspace(low, high, n))
    if not (low > 0 and high > 0):
        raise ValueError(f"{text!r} goes from {low:g} to {high:g}; both ends of a log range are above 0")
    return name, checked_values(name, np.geomspace(low, high, n))


def checked_values(name: str, values: ArrayLike) -> Floats:
    """Values (n,) for one name: finite, at least one, none twice."""
    found = reals(f"values of {name!r}", values, (None,))
    if not found.size:
        raise ValueError(f"{name!r} takes no value; give at least one")
    repeated = sorted({float(value) for value in found if np.count_nonzero(found == value) > 1})
    if repeated:
        raise ValueError(f"{name!r} takes {repeated[0]:g} twice; give each value once")
    return found


def check_size(sizes: Sequence[int]) -> None:
    """ValueError if a grid of these lengths has too many points."""
    points = math.prod(sizes)
    if points > MOST_POINTS:
        grid = " x ".join(map(str, sizes))
        raise ValueError(f"a grid of {grid} = {points} points; at most {MOST_POINTS} are scanned, so take fewer values")


def is_logarithmic(values: Floats) -> bool:
    """Whether values (n,) are better told apart on a logarithmic axis: above 0, and evener in logarithms."""
    if values.size < 3 or values.min() <= 0:
        return False
    ordered = np.sort(values)
    plain, logs = np.diff(ordered), np.diff(np.log(ordered))
    return bool(logs.std() / logs.mean() < plain.std() / plain.mean())


def _number(text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{whole!r}: {text.strip()!r} is no number; {FORMS}") from None
    if not math.isfinite(value):
        raise ValueError(f"{whole!r}: {text.strip()} is not finite; {FORMS}")
    return value


def _count(text: str, whole: str) -> int:
    number = int(text) if len(text) < 10 else MOST_POINTS + 1
    if not 1 <= number <= MOST_POINTS:
        raise ValueError(f"{whole!r} asks for {text} values; expected 1 to {MOST_POINTS}")
    return number
