"""Factors on propensities that depend on how crowded the tank is: on the surface and the volume of all bodies in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats, reals
from kinetics.support.frozen import set_fields


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

    def check(self, shape: tuple[int, int]) -> None:
        """ValueError if the factors are not those of (R, S) channels and species."""
        found = len(self.coefficients), self.weights.size
        if found != shape:
            raise ValueError(f"crowding of {found} channels and species; the network has {shape}")

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
