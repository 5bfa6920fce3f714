"""Break models as models of rates: what the partners of a structure add to the propensity that it breaks."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.named_partners import may_have_broken
from calibration.estimating.rate_model import RateModel
from kinetics.network import Network, Tank
from kinetics.rates.breaks import WALL, BreakModel, ShapeParameter, pairs
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class BreakRates(RateModel):
    """Propensity N b sum over partners w_Y pairs_Y of every break; joins are not covered.

    breaks : the break model
    tank : where the coefficients hold; None where the runs do not know their tank
    values : the shape parameters, in the order of the model's
    by_partner : whether the likelihood is that of who broke what, where a run names the partner; else of the breaks
    """

    breaks: BreakModel
    network: Network
    tank: Tank | None
    values: tuple[float, ...]
    by_partner: bool = False

    terms = ("b",)

    @classmethod
    def of(cls, breaks: BreakModel, network: Network, tank: Tank | None, by_partner: bool = False) -> BreakRates:
        """The break model in a network with one channel a break, its shape where a search starts."""
        return cls(
            breaks, network, tank, tuple(parameter.start for parameter in breaks.parameters(network)), by_partner
        )

    @property
    def name(self) -> str:  # type: ignore[override]
        """That of the break model."""
        return self.breaks.name

    @cached_property
    def shape(self) -> tuple[ShapeParameter, ...]:  # type: ignore[override]
        """That of the break model in this network."""
        return self.breaks.parameters(self.network)

    @property
    def shape_values(self) -> dict[str, float]:
        """The shape parameters by name."""
        return dict(zip((parameter.name for parameter in self.shape), self.values, strict=True))

    def with_shape(self, values: Mapping[str, float]) -> Self:
        """The same model with these values of some of its shape parameters."""
        return replace(self, values=tuple((self.shape_values | dict(values)).values()))

    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """The pairs with each partner, as many as there would be in the tank of the coefficients."""
        parts = pairs(path.network, self.breaks, path.states)
        if self.tank is None or path.tank is None or path.tank == self.tank:
            return parts
        rarer, wall = self.tank.dilution(path.tank), self.tank.wall_factor(path.tank)
        factors = [
            wall if name == WALL else rarer if name in path.network.species_places else 1.0
            for name in self.breaks.partners(path.network)
        ]
        return [factor * part for factor, part in zip(factors, parts, strict=True)]

    def named_parts(self, path: JumpPath) -> NDArray[np.bool_] | None:
        """The partners that the run's record of each break allows (E, P), as `may_have_broken` has it."""
        if not self.by_partner or path.partners is None:
            return None
        names = self.breaks.partners(path.network)
        places = {name: place for place, name in enumerate(names)}
        column = np.array([places.get(name, -1) for name in path.network.species])
        return may_have_broken(path.partners, column, places.get(WALL), len(names))

    def mixture(self) -> Floats:
        """The weights of the partners (1, P)."""
        return np.asarray(self.breaks.weights(self.network, self.shape_values))[None, :]

    @property
    def collected_as(self) -> Hashable:
        """Pairs do not depend on the shape."""
        return self.breaks, self.network, self.tank, self.by_partner
