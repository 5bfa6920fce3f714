"""Rate laws of .net files as expressions: functions of groups and parameters, and the named rate laws."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

from kinetics.network.laws.expression import Expression, quoted


def law_of(name: str, functions: Mapping[str, str], values: Sequence[float], reactants: Sequence[str]) -> Expression:
    """The propensity of a reaction per way: the law times the ordered combinations of its reactants.

    name : of a function without arguments, or one of `KINDS` with its `values`
    """
    if name in functions:
        if values:
            raise ValueError(f"{name!r} is a function without arguments; {len(values)} came")
        return Expression(" * ".join([f"({functions[name]})", *_combinations(reactants)]))
    count, least, text_of = KINDS[name]
    if len(values) != count or len(reactants) < least:
        raise ValueError(
            f"{name} takes {count} numbers and at least {least} reactants; {len(values)} and {len(reactants)} came"
        )
    return Expression(text_of([repr(value) for value in values], reactants))


def _combinations(reactants: Sequence[str]) -> list[str]:
    """Factors n, n - 1, ... for each species."""
    return [
        quoted(species) if i == 0 else f"({quoted(species)} - {i})"
        for species, copies in Counter(reactants).items()
        for i in range(copies)
    ]


def _saturation(values: Sequence[str], reactants: Sequence[str]) -> str:
    k, half = values
    return " * ".join([f"{k} / ({half} + {quoted(reactants[0])})", *_combinations(reactants)])


def _hill(values: Sequence[str], reactants: Sequence[str]) -> str:
    """As `Sat` with powers, but the first reactant is in the law and not multiplied in again."""
    top, half, power = values
    s = quoted(reactants[0])
    return " * ".join([f"{top} * {s} ** {power} / ({half} ** {power} + {s} ** {power})", *_combinations(reactants[1:])])


def _quasi_steady(values: Sequence[str], reactants: Sequence[str]) -> str:
    """The total quasi-steady-state approximation of an enzyme: substrate first, then enzyme."""
    k, half = values
    s, e = quoted(reactants[0]), quoted(reactants[1])
    rest = f"({s} - {half} - {e})"
    free = f"(({rest} + sqrt({rest} ** 2 + 4 * {half} * {s})) / 2)"
    return f"{k} * {e} * {free} / ({half} + {free})"


# Name -> how many numbers it takes, how many reactants at least, and its text.
KINDS: dict[str, tuple[int, int, Callable[[Sequence[str], Sequence[str]], str]]] = {
    "Sat": (2, 1, _saturation),
    "Hill": (3, 1, _hill),
    "MM": (2, 2, _quasi_steady),
}
