"""Parameters of a network: named numbers, of which rate constants and counts at time 0 are formulas."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network.checks import some_names
from kinetics.network.laws.on_demand import is_formula

if TYPE_CHECKING:
    from kinetics.network.laws.expression import Expression

CLOSE = 1e-9  # a count this near, relatively, to a whole number is meant to be it


@dataclass(frozen=True)
class Parameters:
    """The parameters of a network, and what follows from them alone.

    given : name -> number, or a formula of parameters before it
    rates : channel -> its rate constant; channels whose constant is a plain number are left out
    initial : species -> its count at time 0; species without a stated count are left out
    """

    given: Mapping[str, float | Expression] = field(default_factory=dict)
    rates: Mapping[str, Expression] = field(default_factory=dict)
    initial: Mapping[str, int | Expression] = field(default_factory=dict)

    @cached_property
    def values(self) -> dict[str, float]:
        """Name -> number; ValueError if one is none, or not finite."""
        values: dict[str, float] = {}
        for name, each in self.given.items():
            values[name] = number_of(f"parameter {name!r}", each, values)
        return values

    @cached_property
    def counts(self) -> dict[str, int]:
        """Species -> its count at time 0."""
        return {name: self.count(name) for name in self.initial}

    def changed(self, values: Mapping[str, float]) -> Parameters:
        """A copy with new numbers for these parameters; formulas that read them change too."""
        for name in values:
            if name not in self.given:
                if name in self.initial:
                    raise ValueError(f"{name!r} is a species; counts at time 0 are given by initial, --initial")
                raise ValueError(f"unknown parameter {name!r}{meant(name, self.given)}; there are {self._some()}")
        numbers = {name: number_of(f"parameter {name!r}", value, {}) for name, value in values.items()}
        return replace(self, given={**self.given, **numbers})

    def without_rates(self, channels: Iterable[str]) -> Parameters:
        """A copy without the formulas of these rate constants, which are then plain numbers, or laws."""
        named = set(channels)
        return replace(self, rates={name: k for name, k in self.rates.items() if name not in named}) if named else self

    def constants(self, channels: Mapping[str, int], rate_constants: ArrayLike | None) -> ArrayLike | None:
        """The rate constants (R,), with their values if they are formulas of parameters."""
        if not self.rates:
            return rate_constants
        found = np.zeros(len(channels)) if rate_constants is None else np.array(rate_constants, dtype=np.float64)
        known: dict[int, float] = {}  # of the formulas, which channels may share
        for name, formula in self.rates.items():
            if id(formula) not in known:
                what = f"the rate constant of channel {name!r}"
                known[id(formula)] = number_of(what, formula, self.values)
                if known[id(formula)] < 0:
                    raise ValueError(f"{what}, {formula.text}, is {known[id(formula)]:g}; expected at least 0")
            found[channels[name]] = known[id(formula)]
        return found

    def check(self, channels: Iterable[str], species: Iterable[str], laws: Mapping[str, Expression]) -> None:
        """ValueError if a name means two things, or a formula is of a channel that there is not."""
        both = self.given.keys() & set(species)
        if both:
            raise ValueError(f"{min(both)!r} is both a species and a parameter; rename one")
        unknown = self.rates.keys() - set(channels)
        if unknown or self.rates.keys() & laws.keys():
            name = min(unknown or self.rates.keys() & laws.keys())
            raise ValueError(f"a rate constant for channel {name!r}, which has a law or does not exist")
        for channel, law in laws.items():
            for name, value in law.parameters.items():
                if self.values.get(name, value) != value:
                    raise ValueError(
                        f"parameter {name!r} is {value:g} in the law of channel {channel!r} and "
                        f"{self.values[name]:g} elsewhere; rename one"
                    )

    def count(self, name: str) -> int:
        """The count of a species at time 0; ValueError if it is no whole number of at least 0."""
        given = self.initial[name]
        if not is_formula(given):
            return given
        value = number_of(f"count of {name!r}", given, self.values)
        if not 0 <= value < 2.0**63 or abs(value - round(value)) > CLOSE * value:
            raise ValueError(f"{value:g} copies of {name!r}, {given.text}; expected a whole number of at least 0")
        return round(value)

    def _some(self) -> str:
        return some_names(self.given) or "none"


def number_of(what: str, given: float | Expression, values: Mapping[str, float]) -> float:
    """The number that a formula of parameters comes to; a ValueError that says of what, if it is none."""
    if is_formula(given):
        from kinetics.network.laws.program import known_numbers

        found = known_numbers(given.with_parameters(values))[-1]
        if found is None:
            raise ValueError(f"{what}, {given.text}, comes to no finite number")
        return found
    if isinstance(given, bool | str) or not hasattr(given, "__float__") or not math.isfinite(given):
        raise ValueError(f"{what} = {given!r}; expected a finite number")
    return float(given)


def meant(name: str, known: Iterable[str]) -> str:
    """A hint with similar names, `(did you mean ...?)`; empty if there are none."""
    near = difflib.get_close_matches(name, list(known), n=2, cutoff=0.5)
    return f" (did you mean {' or '.join(near)}?)" if near else ""
