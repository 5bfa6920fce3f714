"""Factors on propensities that depend on how crowded the tank is: on the surface and the volume of all bodies in it."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network.network import Network
from kinetics.support.arrays import Floats, reals
from kinetics.support.frozen import set_fields

if TYPE_CHECKING:
    from kinetics.network.laws import Expression


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
        z = ((counts @ self.weights) / free)[..., None]
        # Horner's rule for the terms from c_1 on, which share 1 / (1 - phi)
        found = np.zeros((*z.shape[:-1], len(self.coefficients)))
        for column in self.coefficients.T[:0:-1]:
            found = found * z + column
        return np.asarray(found / free[..., None] + self.coefficients[:, 0])

    def laws(self, network: Network) -> dict[str, Expression]:
        """The rate laws of the channels that the crowd changes: combinations of reactants times the factor.

        A network with these laws is sampled by `general` and solved like any other with rate laws, with their proven
        bounds on rounding. Cost: linear in channels times species. ValueError: factors of another network.

        >>> from kinetics.network import Crowding, Network
        >>> pairs = Network.from_text("hit: AA + A -> 3 A, 0.1")
        >>> Crowding([0.0, 0.0], [0.1, 0.2], [[0.5, 1.0]]).laws(pairs)["hit"].text
        'AA * A * (0.5 + (1) / (1 - (0.1 * AA + 0.2 * A)))'
        """
        from kinetics.network.laws import Expression
        from kinetics.network.laws.writing import quoted

        found = len(self.coefficients), self.weights.size
        if found != (len(network.channels), len(network.species)):
            raise ValueError(f"factors for {found[0]} channels among {found[1]} species; {network.headline}")
        names = [quoted(name) for name in network.species]
        free, surface = f"(1 - ({_sum(self.volumes, names)}))", f"({_sum(self.weights, names)})"
        laws = {}
        for channel, (first, *rest) in enumerate(self.coefficients.tolist()):
            if first == 1.0 and not any(rest):
                continue
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
