"""Break models as models of rates: what the partners of a structure add to the propensity that it breaks."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from calibration.estimating.exposure import Crowd, crowding_of, sojourns
from calibration.estimating.named_partners import may_have_broken, of_the_named
from calibration.estimating.rate_model import RateModel
from kinetics.network import Network, Tank
from kinetics.rates.breaks import WALL, BreakModel, Expansion, ShapeParameter, pairs
from kinetics.rates.breaks.base import body_sizes
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats, Ints


@dataclass(frozen=True, kw_only=True)
class BreakRates(RateModel):
    """Propensity N b sum over partners w_Y pairs_Y of every break; joins are not covered.

    breaks : the break model
    tank : where the coefficients hold; None if the runs do not know their tank
    crowd : factors on propensities in an expanded network and tank; None for mass action
    values : the shape parameters, in the order of the model's
    by_partner : whether the likelihood is that of who broke what, where a run names the partner; else of the breaks
    """

    breaks: BreakModel
    tank: Tank | None
    values: tuple[float, ...]
    by_partner: bool = False
    crowd: Crowd | None = None

    terms = ("b",)

    @property
    def name(self) -> str:  # type: ignore[override]
        """The name of the break model."""
        return self.breaks.name

    @property
    def shape_values(self) -> dict[str, float]:
        """The shape parameters by name."""
        return dict(zip((parameter.name for parameter in self.shape), self.values, strict=True))

    def with_shape(self, values: Mapping[str, float]) -> Self:
        """The model with these values of some of its shape parameters."""
        return replace(self, values=tuple((self.shape_values | dict(values)).values()))

    def scales(self, path: JumpPath) -> tuple[float, float]:
        """Factors from the tank of a run to that of the coefficients: for pairs of bodies, and for hits on walls."""
        if self.tank is None or path.tank is None or path.tank == self.tank:
            return 1.0, 1.0
        return self.tank.dilution(path.tank), self.tank.wall_factor(path.tank)


@dataclass(frozen=True, kw_only=True)
class BreaksBySpecies(BreakRates):
    """Partners are the species of one network, which may each have a weight of their own."""

    network: Network

    @classmethod
    def of(
        cls,
        breaks: BreakModel,
        network: Network,
        tank: Tank | None,
        by_partner: bool = False,
        crowd: Crowd | None = None,
    ) -> Self:
        """The break model in a network with one channel a break, its shape where a search starts."""
        values = tuple(parameter.start for parameter in breaks.parameters(network))
        return cls(breaks=breaks, network=network, tank=tank, values=values, by_partner=by_partner, crowd=crowd)

    @cached_property
    def _expansion(self) -> Expansion:
        return Expansion.of(self.network, self.breaks)

    @cached_property
    def shape(self) -> tuple[ShapeParameter, ...]:  # type: ignore[override]
        """The shape parameters of the break model in this network."""
        return self.breaks.parameters(self.network)

    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """The pairs with each partner, as many as there would be in the tank of the coefficients, times the crowd's
        factor in the tank of the run."""
        rarer, wall = self.scales(path)
        factors = [
            wall if name == WALL else rarer if name in path.network.species_places else 1.0
            for name in self.breaks.partners(path.network)
        ]
        parts = pairs(path.network, self.breaks, path.states)
        parts = [part if factor == 1 else factor * part for factor, part in zip(factors, parts, strict=True)]
        crowding = crowding_of(self.crowd, self._expansion, path.tank)
        if crowding is None:
            return parts
        crowded, found = crowding.factors(path.states), self._expansion
        for p, part in enumerate(parts):
            mine = np.flatnonzero(found.partner_of == p)
            part[:, found.base_of[mine]] *= crowded[:, mine]
        return parts

    def collected(self, path: JumpPath, rows: Ints) -> tuple[Floats, Floats]:
        """Integrals of the parts over a path, and the parts at its events, of the partners that its record allows."""
        integrals, at_events = super().collected(path, rows)
        if not self.by_partner or path.partners is None:
            return integrals, at_events
        names = self.breaks.partners(path.network)
        places = {name: place for place, name in enumerate(names)}
        column = np.array([places.get(name, -1) for name in path.network.species])
        named = may_have_broken(path.partners[rows], column, places.get(WALL), len(names))
        return integrals, of_the_named(at_events, named)

    def mixture(self) -> Floats:
        """The weights of the partners (1, P)."""
        return np.asarray(self.breaks.weights(self.network, self.shape_values))[None, :]

    @property
    def cache_key(self) -> Hashable:
        """The model without its shape, on which the pairs do not depend."""
        return self.breaks, self.network, self.tank, self.by_partner, self.crowd


@dataclass(frozen=True, kw_only=True)
class BreaksBySize(BreakRates):
    """Partners are bodies of 1, 2, ... `largest` cubes, then the wall, then none: any networks can be pooled."""

    largest: int

    @classmethod
    def of(cls, breaks: BreakModel, largest: int, tank: Tank | None, by_partner: bool = False) -> Self:
        """The break model, its shape where a search starts. ValueError: its weights are not given by sizes."""
        values = {parameter.name: parameter.start for parameter in breaks.size_parameters}
        breaks.by_size(np.ones(1), values)
        return cls(breaks=breaks, largest=largest, tank=tank, values=tuple(values.values()), by_partner=by_partner)

    @property
    def shape(self) -> tuple[ShapeParameter, ...]:  # type: ignore[override]
        """The shape parameters of the break model."""
        return self.breaks.size_parameters

    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """The pairs of each structure with bodies of each size, with the wall, and the structures themselves."""
        around, own, whole = self._around(path)
        h = path.states[:, whole]
        return [h * (around[:, [p]] - own[whole, p]) for p in range(around.shape[1])]

    def collected(self, path: JumpPath, rows: Ints) -> tuple[Floats, Floats]:
        """Structures times partners, summed over time for each structure and not for each channel: these are many."""
        begin, end, _ = sojourns(path)
        around, own, whole = self._around(path)
        held = (end - begin)[:, None] * path.states
        integrals = (held.T @ around - own * held.sum(axis=0)[:, None]).T
        fired = path.channels[rows]
        broken = whole[fired]
        of_one = path.network.ways[fired] * path.states[rows, broken]
        at_events = of_one[:, None] * (around[rows] - own[broken])
        if self.by_partner and path.partners is not None:
            column = body_sizes(path.network).astype(np.int64) - 1
            named = may_have_broken(path.partners[rows], column, self.largest, self.largest + 2)
            at_events = of_the_named(at_events, named)
        return integrals[:, whole] * path.network.ways * path.open_channels, at_events

    def _around(self, path: JumpPath) -> tuple[Floats, Floats, Ints]:
        """Partners (E + 1, P) in each state, partners (S, P) that a structure is itself, and what breaks (R,).

        All are in the tank of the coefficients. A join has the first species, whose numbers are not used.
        """
        rarer, wall = self.scales(path)
        sizes = body_sizes(path.network)
        own = np.column_stack([rarer * (sizes[:, None] == np.arange(1, self.largest + 1)), np.zeros((sizes.size, 2))])
        around = path.states @ own + np.append(np.zeros(self.largest), [wall, 1.0])
        needed = path.network.sparse_reactants
        whole = np.zeros(len(path.network.channels), dtype=np.int64)
        whole[needed.rows] = needed.columns
        return around, own, whole

    def mixture(self) -> Floats:
        """The weights of the partners (1, P)."""
        bodies, wall, alone = self.breaks.by_size(np.arange(1.0, self.largest + 1), self.shape_values)
        return np.append(bodies, [wall, alone])[None, :]

    @property
    def cache_key(self) -> Hashable:
        """Partners depend neither on the shape nor on the break model."""
        return self.largest, self.tank, self.by_partner
