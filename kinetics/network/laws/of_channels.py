"""Laws of channels: checked, made programs that obey `at_zero`, evaluated, and their rounding bounded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network.laws.enclosure import enclosed
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code
from kinetics.network.laws.program import Step, evaluate, steps_of
from kinetics.network.propensity import state_text
from kinetics.support.arrays import Floats, Ints

ROUNDING = 2.0**-53  # largest relative error of one operation
WORST = 1e-3  # relative error; what is known no better is taken as not known
PIECE = 2**15  # states whose laws are enclosed at a time, which then stay in the cache


@dataclass(frozen=True, eq=False)
class ChannelLaw:
    """The rate law of one channel, h(s, t) in place of the combinations of its reactants.

    places : species -> its position, for all species
    needed : positions (n,) and copies (n,) of the channel's reactants
    at_zero : one of `AT_ZERO`
    """

    channel: str
    law: Expression
    places: Mapping[str, int]
    needed: tuple[Ints, Ints]
    at_zero: str

    @cached_property
    def program(self) -> list[Step]:
        """The law as a program that obeys `at_zero` if reactants are missing."""
        needs = list(zip(*(part.tolist() for part in self.needed), strict=True))
        if self.at_zero == "block":
            return [*(Step(Code.GUARD, s, float(copies)) for s, copies in needs), *self._bare]
        return [*self._bare, *(Step(Code.REFUSE, s, float(copies)) for s, copies in needs)]

    @cached_property
    def _bare(self) -> list[Step]:
        return steps_of(self.law, self.places)

    @cached_property
    def _unrounded(self) -> list[Step]:
        """The program with all of its operations, none done beforehand."""
        guards = [step for step in self.program if step.code == Code.GUARD]
        return [*guards, *steps_of(self.law, self.places, folds=False)]

    def rate_error(self, states: Ints, constant: float, ways: float) -> float:
        """Bound on the relative error of the rates constant * ways * h at states (N, S), in roundings of 2**-53.

        The largest over the states, beside the law's real value (see `laws.enclosure`); inf if it is not known to
        three digits, or not whether it is 0. The law depends on no time.
        """
        factors = [Step(Code.CONSTANT, 0, constant), Step(Code.MULTIPLY), Step(Code.CONSTANT, 0, ways)]
        steps = [*self._unrounded, *factors, Step(Code.MULTIPLY)]
        worst = 0.0
        for begin in range(0, len(states), PIECE):
            part = states[begin : begin + PIECE]
            found = constant * ways * evaluate(self.program, part, 0.0)
            low, high = enclosed(steps, part)
            wrong, least = np.maximum(high - found, found - low), np.minimum(low, found)
            with np.errstate(all="ignore"):
                relative = np.where((low == found) & (high == found), 0.0, wrong / least)
            is_known = (least > 0.0) | (relative == 0.0)
            worst = max(worst, float(np.where(is_known, relative, np.inf).max()))
            if not worst <= WORST:
                return np.inf
        return 1.001 * worst / ROUNDING

    def values(self, states: Ints, time: float) -> Floats:
        """h (...) at states (..., S) and a time in tu; ValueError if it is below 0, infinite or undefined."""
        values = evaluate(self.program, states, time)
        bad = ~((values >= 0.0) & (values < np.inf))
        if bad.any():
            raise ValueError(self.refusal(states[bad][0], time))
        return values

    def refusal(self, state: Ints, time: float) -> str:
        """The message that says what is wrong with the law in a state (S,)."""
        value = float(evaluate(self._bare, state, time))
        where = f"at {state_text(list(self.places), state)}" + (f", t = {time:.17g} tu" if self.law.reads_time else "")
        came = f"the law of channel {self.channel!r}, {self.law}, is {value:g} {where}"
        if self.at_zero == "refuse" and value > 0 and np.any(state[self.needed[0]] < self.needed[1]):
            return f"{came}, where its reactants are missing; correct the law, or block it there with at_zero='block'"
        return (
            f"{came}; expected a finite number of at least 0: correct it, or write max(0, ...) or piecewise(...) if "
            f"that is meant"
        )


def checked_laws(
    laws: Mapping[str, str | Expression], channels: Mapping[str, int], species: Mapping[str, int]
) -> dict[str, Expression]:
    """The laws, parsed, of channels that exist, in terms of species that exist; in the order of the channels."""
    checked = {}
    for name, law in laws.items():
        if name not in channels:
            raise ValueError(f"a law for channel {name!r}, which the network does not have")
        checked[name] = _parsed(name, law, {})
        checked[name].check_names(f"law of channel {name!r}", species)
    return {name: checked[name] for name in sorted(checked, key=channels.__getitem__)}


def _parsed(channel: str, law: str | Expression, parameters: Mapping[str, float]) -> Expression:
    try:
        return law if isinstance(law, Expression) else Expression(law, parameters)
    except ValueError as error:
        raise ValueError(f"law of channel {channel!r}: {error}") from None


def split_rates(
    given: Any, channels: tuple[str, ...], parameters: Mapping[str, float]
) -> tuple[ArrayLike | None, dict[str, Expression]]:
    """Rate constants, 1 if there is a law, and the laws."""
    if isinstance(given, str | Mapping):
        raise ValueError(f"rates are {given!r}; expected a sequence, one rate constant or law a channel")
    rates = None if given is None else list(given)
    laws: dict[str, Expression] = {}
    if rates is None or not any(isinstance(rate, str | Expression) for rate in rates):
        return given, laws
    if len(rates) != len(channels):
        raise ValueError(f"{len(rates)} rates or laws came; expected one for each of {len(channels)} channels")
    for r, (name, rate) in enumerate(zip(channels, rates, strict=True)):
        if isinstance(rate, str | Expression):
            laws[name], rates[r] = _parsed(name, rate, parameters), 1.0
    return rates, laws
