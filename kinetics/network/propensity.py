"""The factor h(s, t) of a propensity k * N * h: combinations of reactants under mass action, or another rate law.

It is computed from rows: the reactants of a channel, their copies, and the law that takes the place of h, if any.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb, factorial, lgamma, log, perm
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code
from kinetics.network.laws.program import Step, evaluate, steps_of
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats, Ints

# What h(s) counts for m like reactants among s copies:
#   distinct  sets of m copies, s!/(m!(s-m)!), for a pair s(s-1)/2
#   ordered   sequences of m copies, s!/(s-m)!, for a pair s(s-1)
#   product   s**m, zero below m copies: the paper's multiplicity M in eqs 9-10, taken to the letter
COMBINATIONS = ("distinct", "ordered", "product")
# So many like reactants among 2**63 - 1 copies still have fewer combinations than a float can hold.
LOW_ORDER = 16
LOG_LARGEST = 710.0  # of a float, rounded up
ROUNDING = 2.0**-53  # largest relative error of one operation
WORST = 1e-3  # relative error; what is known no better is taken as not known
PIECE = 2**15  # states whose laws are enclosed at a time, which then stay in the cache
# What becomes of a rate law that is above 0 although reactants are missing:
#   block   the channel waits until they are there
#   refuse  a ValueError that names the channel and the state
AT_ZERO = ("block", "refuse")


def combinations(copies: Ints, taken: int, counted: str) -> Floats:
    """Ways (...) to take `taken` of `copies` (...), counted as one of `COMBINATIONS`; cost: `taken` products.

    Floats: 1e15 copies do not overflow. A ValueError where the number is beyond all floats, 1.8e308.
    """
    if taken > LOW_ORDER:
        return _combinations_of_many(copies, taken, counted)
    available = copies.astype(np.float64)
    if counted == "product":  # not by the library's power, which rounds more often
        return np.where(copies >= taken, np.prod([available] * taken, axis=0), 0.0)
    # With fewer copies than taken, one of the factors is exactly 0; the clip keeps the others from going below.
    ordered = np.prod([np.maximum(available - i, 0.0) for i in range(taken)], axis=0)
    return ordered if counted == "ordered" else ordered / factorial(taken)


def _combinations_of_many(copies: Ints, taken: int, counted: str) -> Floats:
    """The same in whole numbers without limit, each rounded once: numerator and denominator may be no floats."""
    exact = {"distinct": comb, "ordered": perm, "product": lambda s, m: s**m if s >= m else 0}[counted]
    found, where = np.unique(copies, return_inverse=True)
    try:
        if _least_log(int(found[-1]), taken, counted) > LOG_LARGEST:
            raise OverflowError
        values = np.array([float(exact(s, taken)) for s in found.tolist()])
    except OverflowError:
        raise ValueError(
            f"{taken} like reactants among {found[-1]} copies have more combinations ({counted!r}) than a float can "
            f"hold, 1.8e308; start from fewer copies, or write the reaction in steps of fewer reactants"
        ) from None
    return values[where].reshape(copies.shape)


def _least_log(copies: int, taken: int, counted: str) -> float:
    """A number that the logarithm of the combinations is not below: the whole number itself may take minutes."""
    if copies < taken:
        return -np.inf
    if counted == "distinct":  # (n/k)**k
        k = min(taken, copies - taken)
        return k * log(copies / k) if k else 0.0
    return lgamma(taken + 1.0) if counted == "ordered" else taken * log(copies)


def mass_action(needed: SparseTable, counts: Ints, counted: str, channels: Sequence[str]) -> Floats:
    """Combinations (..., R) of the reactants of every channel in states (..., S); cost: their product."""
    h = np.ones((*counts.shape[:-1], len(channels)))
    places = np.arange(needed.rows.size) - needed.starts[needed.rows]  # first, second, ... reactant of its channel
    for place, taken in set(zip(places.tolist(), needed.copies.tolist(), strict=True)):
        alike = (places == place) & (needed.copies == taken)
        rows, columns = needed.rows[alike], needed.columns[alike]
        try:
            with np.errstate(over="raise"):
                h[..., rows] *= combinations(counts[..., columns], taken, counted)
        except (ValueError, FloatingPointError) as error:
            most = counts.reshape(-1, counts.shape[-1]).max(axis=0)  # the channel that finds the most copies of its own
            name = channels[int(rows[np.argmax(most[columns])])]
            raise ValueError(f"channel {name!r}: its reactants have too many combinations: {error}") from None
    return h


def over_factorial(coefficient: float, copies: int, channel: str) -> float:
    """A coefficient divided by copies!, as sampling needs it for like reactants counted as distinct sets.

    A ValueError where that is no normal float any more, from 171 copies on or with a small rate constant.
    """
    share = coefficient / float(factorial(copies)) if copies <= 170 else 0.0
    if coefficient > 0 and share < np.finfo(np.float64).tiny:
        raise ValueError(
            f"channel {channel!r} needs {copies} copies of one species: {coefficient:g} over {copies}! is too small "
            f"for a float; write the reaction in steps of fewer reactants"
        )
    return share


@dataclass(frozen=True, eq=False)
class ChannelLaw:
    """The rate law of one channel, h(s, t) in the place of the combinations of its reactants.

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
        """The law as a program that obeys `at_zero` where reactants are missing."""
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

        The largest over the states, beside the law's real value (see `laws.enclosure`); inf where it is not known to
        three digits, or not whether it is 0. The law depends on no time.
        """
        from kinetics.network.laws.enclosure import enclosed

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
        """h (...) at states (..., S) and a time in tu; a ValueError where it is below 0, infinite or undefined."""
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
            return (
                f"{came}, where its reactants are missing; correct the law, or let it wait for them with "
                f"at_zero='block'"
            )
        return (
            f"{came}; expected a finite number of at least 0: correct it, or write max(0, ...) or piecewise(...) where "
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
    """Rate constants, 1 where there is a law, and the laws."""
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


def check_homogeneous(laws: Mapping[str, Expression], events: Iterable[str]) -> None:
    """A ValueError where laws depend on the time, or events (by name) set counts: no constant generator then."""
    for name, law in laws.items():
        if law.reads_time:
            raise ValueError(
                f"the law of channel {name!r}, {law}, depends on the time; without a time there is no propensity, "
                f"and the chain has no constant generator: sample it with the method 'general'"
            )
    names = ", ".join(events)
    if names:
        raise ValueError(
            f"the network has events ({names}), so its counts are no "
            f"Markov chain with a constant generator: sample it with the method 'general'"
        )


def state_text(species: Sequence[str], state: Ints) -> str:
    """A state by the names of its species, those at 0 left out where there are many."""
    pairs = [(name, int(n)) for name, n in zip(species, state, strict=True) if n or len(species) <= 8]
    text = ", ".join(f"{name} = {n}" for name, n in pairs[:12])
    return text + (f" and {len(pairs) - 12} more" if len(pairs) > 12 else "") if pairs else "no copies at all"
