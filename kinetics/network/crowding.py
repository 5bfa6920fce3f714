"""Factors on propensities that depend on how crowded the tank is: on the surface and the volume of all bodies in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import factorial, inf
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats, reals
from kinetics.support.frozen import set_fields

if TYPE_CHECKING:
    from kinetics.network.laws import Expression

ROUNDED = 1e-12  # relative, by which bounds are wider than computed


class Reactions(Protocol):
    """What the laws of a network in a crowd are written from."""

    @property
    def species(self) -> tuple[str, ...]:
        """S names."""

    @property
    def channels(self) -> tuple[str, ...]:
        """R names."""

    @property
    def sparse_reactants(self) -> SparseTable:
        """Copies (R, S) that a firing needs."""

    @property
    def combinations(self) -> str:
        """How like reactants are counted."""


@dataclass(frozen=True, eq=False)
class Crowding:
    """Factors on the propensities of R channels in a crowd of bodies of S species.

    factor = c_0 + c_1 / (1 - phi) + c_2 s / (1 - phi)^2 + c_3 s^2 / (1 - phi)^3 + ...

    weights : (S,) >= 0, what one copy of each species adds to s, such as its surface per volume of the tank
    volumes : (S,) >= 0, what it adds to phi, the share of the tank that bodies fill
    coefficients : (R, D) c >= 0, so that a factor never falls as s or phi rises; (1, 0, ...) leaves a channel as it is
    ValueError: another shape, or negative numbers

    The form is that of the contact values of hard bodies, see `kinetics.rates.crowding`. Cost of the factors: linear
    in states times (species + channels).

    >>> from kinetics.network import Crowding
    >>> crowding = Crowding([0.5, 1.0], [0.0, 0.1], [[1, 0, 0], [0, 1, 2]])  # two species, two channels
    >>> crowding.factors([[2, 0], [0, 5]]).tolist()
    [[1.0, 3.0], [1.0, 42.0]]
    """

    weights: Floats
    volumes: Floats
    coefficients: Floats

    def __post_init__(self) -> None:
        weights = reals("weights", self.weights, (None,), minimum=0)
        set_fields(
            self,
            weights=weights,
            volumes=reals("volumes", self.volumes, weights.shape, minimum=0),
            coefficients=reals("coefficients", self.coefficients, (None, None), minimum=0),
        )

    def factors(self, states: ArrayLike) -> Floats:
        """Factors (..., R) on the propensities in states (..., S). ValueError: the bodies fill the tank."""
        counts = np.asarray(states, dtype=float)
        free = 1.0 - counts @ self.volumes
        if not np.all(free > 0):
            raise ValueError(
                f"bodies fill {1 - np.min(free):.3g} of the tank; expected less than 1: fewer bodies, or a larger tank"
            )
        return self.factors_at(counts @ self.weights, free)

    def factors_at(self, surface: ArrayLike, free: ArrayLike) -> Floats:
        """Factors (..., R) at s (...) and 1 - phi (...)."""
        free = np.asarray(free, dtype=float)
        z = (np.asarray(surface) / free)[..., None]
        # Horner's rule for the terms from c_1 on, which share 1 / (1 - phi)
        found = np.zeros((*z.shape[:-1], len(self.coefficients)))
        for column in self.coefficients.T[:0:-1]:
            found = found * z + column
        return np.asarray(found / free[..., None] + self.coefficients[:, 0])

    @cached_property
    def is_changed(self) -> NDArray[np.bool_]:
        """(R,) whether the crowd changes a channel."""
        return np.asarray((self.coefficients[:, 0] != 1) | self.coefficients[:, 1:].any(axis=1))

    def ranges(self, conserved: Mapping[str, Floats], state: ArrayLike) -> tuple[Floats, Floats]:
        """Lowest and highest s and phi (2,), (2,) among all states that hold the same conserved quantities as one (S,).

        conserved : name -> its amount (S,) in one copy of each species, as of `Network`

        They are proven, and not the narrowest: each is bounded by its least and largest share in a unit of one
        quantity, or of all together. The highest is inf where nothing bounds it.
        Cost: linear in species times quantities.

        >>> from kinetics.network import Crowding
        >>> low, high = Crowding([0.5, 0.8], [0.0, 0.0], [[0, 1, 2]]).ranges({"parts": [1, 2]}, [10, 0])
        >>> low.round(9).tolist(), high.round(9).tolist()  # from 5 pairs to 10 single ones
        ([4.0, 0.0], [5.0, 0.0])
        """
        counts, shares = np.asarray(state, dtype=float), np.stack([self.weights, self.volumes])
        amounts = [np.asarray(each, dtype=float) for each in conserved.values()]
        amounts = [each for each in amounts if each.min() >= 0 and each.any()]
        low, high = np.zeros(2), np.full(2, inf)
        for amount in [*amounts, *([np.sum(amounts, axis=0)] if len(amounts) > 1 else [])]:
            holds = amount > 0
            ratios = (amount @ counts) * shares[:, holds] / amount[holds]
            low = np.maximum(low, ratios.min(axis=1))
            high = np.where(shares[:, ~holds].any(axis=1), high, np.minimum(high, ratios.max(axis=1)))
        return low * (1 - ROUNDED), high * (1 + ROUNDED)

    def laws(self, network: Reactions) -> dict[str, Expression]:
        """The rate laws of the channels that the crowd changes: combinations of reactants times the factor.

        `Network.crowding` puts them into a network, which is then solved and written like any other with rate laws,
        with their proven bounds on rounding. Cost: linear in channels times species.
        ValueError: factors of another network.

        >>> from kinetics.network import Crowding, Network
        >>> pairs = Network.from_text("hit: AA + A -> 3 A, 0.1")
        >>> Crowding([0.0, 0.0], [0.1, 0.2], [[0.5, 1.0]]).laws(pairs)["hit"].text
        'AA * A * (0.5 + (1) / (1 - (0.1 * AA + 0.2 * A)))'
        """
        from kinetics.network.laws import Expression
        from kinetics.network.laws.writing import quoted

        found = len(self.coefficients), self.weights.size
        if found != (len(network.channels), len(network.species)):
            raise ValueError(
                f"factors for {found[0]} channels among {found[1]} species; the network has {len(network.channels)} "
                f"channels among {len(network.species)} species"
            )
        names = [quoted(name) for name in network.species]
        free, surface = f"(1 - ({_sum(self.volumes, names)}))", f"({_sum(self.weights, names)})"
        laws = {}
        for channel in np.flatnonzero(self.is_changed).tolist():
            first, *rest = self.coefficients[channel].tolist()
            places, copies = (part.tolist() for part in network.sparse_reactants.row(channel))
            taken = [_taken(names[s], n, network.combinations) for s, n in zip(places, copies, strict=True)]
            # Horner's rule in s / (1 - phi)
            inner = ""
            for number in reversed(rest):
                inner = f"{number!r} + {surface} / {free} * ({inner})" if inner else f"{number:.17g}"
            laws[network.channels[channel]] = Expression(" * ".join([*taken, f"({first!r} + ({inner or 0}) / {free})"]))
        return laws


def _sum(weights: Floats, names: list[str]) -> str:
    """A weighted sum of counts as text."""
    return " + ".join(f"{w!r} * {name}" for w, name in zip(weights.tolist(), names, strict=True) if w) or "0"


def _taken(name: str, copies: int, counted: str) -> str:
    """Combinations of like copies as text, see `propensity.COMBINATIONS`."""
    if counted == "product":
        return " * ".join([name] * copies)
    ordered = " * ".join([name, *(f"({name} - {i})" for i in range(1, copies))])
    return ordered if counted == "ordered" or copies < 2 else f"{ordered} / {factorial(copies)}"
