"""Networks in which breaks have partners: in the place of each break, one mass-action channel per partner."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network, Tank
from kinetics.network.sparse_tables import SparseTable
from kinetics.rates.breaks.base import ALONE, WALL, BreakModel
from kinetics.support.arrays import Floats, Ints

SMALLEST = float(np.finfo(float).tiny)  # below, digits are lost
BY = " by "  # between a break and its partner, in the name of a channel


def base_channel(name: str) -> str:
    """The join or break to which a channel belongs, for any partner.

    >>> base_channel("2->1+1 by quadmer")
    '2->1+1'
    """
    return name.split(BY, maxsplit=1)[0]


def is_break(network: Network) -> NDArray[np.bool_]:
    """Channels (R,) in which one body is used up and becomes several.

    >>> from kinetics import Network
    >>> from kinetics.rates.breaks import is_break
    >>> is_break(Network.from_text("2 A <-> AA, 0.01, 0.1")).tolist()
    [False, True]
    """
    order, gain = _totals(network.sparse_reactants), _totals(network.sparse_stoichiometry)
    is_used_up = network.sparse_stoichiometry.at(network.sparse_reactants.keys) < 0
    used = np.zeros(order.size, dtype=bool)
    used[network.sparse_reactants.rows[is_used_up]] = True
    return np.asarray((order == 1) & (gain >= 1) & used)


@dataclass(frozen=True, eq=False)
class Expansion:
    """A network whose breaks have partners, and where its channels come from.

    base : network with one channel a break
    base_of : (R',) position in `base` of the channel that each channel belongs to
    partner_of : (R',) position of its partner among the model's, -1 for a channel that is no break

    >>> from dataclasses import replace
    >>> from kinetics import Network
    >>> from kinetics.rates.breaks import Expansion, break_model
    >>> pair = replace(Network.from_text("pair: 2 A <-> AA, 0.01, 0.1"), conserved={"cubes": [1, 2]})
    >>> Expansion.of(pair, break_model("collision")).network.channels
    ('pair', 'pair backward by A', 'pair backward by AA')
    """

    base: Network
    model: BreakModel
    network: Network
    base_of: Ints
    partner_of: Ints

    @classmethod
    def of(cls, base: Network, model: BreakModel) -> Expansion:
        """The network that a break model makes of `base`. Cost: linear in breaks times partners."""
        partners = model.partners(base)
        breaks = is_break(base)
        if partners == (ALONE,):
            return cls(base, model, base, np.arange(breaks.size), np.where(breaks, 0, -1))
        if base.laws or base.events:
            raise ValueError(f"break model {model.name!r} takes mass action only; this network has rate laws or events")
        if base.combinations == "product":
            raise ValueError(
                f"break model {model.name!r} counts pairs of like bodies, unlike the convention 'product'; use "
                f"rates with combinations = 'distinct'"
            )
        if WALL in partners and WALL in base.species:
            raise ValueError(f"break model {model.name!r} calls the wall of the tank {WALL!r}; rename that species")
        base_of = np.concatenate([np.full(len(partners) if b else 1, r) for r, b in enumerate(breaks)])
        partner_of = np.concatenate([np.arange(len(partners)) if b else [-1] for b in breaks]).astype(np.int64)
        species = np.array([base.species_places.get(name, -1) for name in partners])
        partner_species = np.where(partner_of >= 0, species[partner_of], -1)
        meets = np.flatnonzero(partner_species >= 0)
        needed = base.sparse_reactants.picked(base_of)
        shape = (base_of.size, len(base.species))
        reactants = SparseTable.of_entries(
            shape,
            np.concatenate([needed.rows, meets]),
            np.concatenate([needed.columns, partner_species[meets]]),
            np.concatenate([needed.copies, np.ones_like(meets)]),
        )
        # Of two like bodies either may break: x (x - 1) pairs, twice the distinct ones.
        alike = np.zeros(base_of.size, dtype=bool)
        alike[reactants.rows[reactants.copies == 2]] = True
        twice = alike & (partner_of >= 0) & (base.combinations == "distinct")
        names = [
            base.channels[r] + ("" if p < 0 else f"{BY}{partners[p]}") for r, p in zip(base_of, partner_of, strict=True)
        ]
        network = Network(
            base.species,
            tuple(names),
            reactants,
            base.sparse_stoichiometry.picked(base_of),
            base.ways[base_of] * np.where(twice, 2.0, 1.0),
            combinations=base.combinations,
            conserved=base.conserved,
            time_unit=base.time_unit,
        )
        return cls(base, model, network, base_of, partner_of)

    @cached_property
    def _is_wall(self) -> NDArray[np.bool_]:
        wall = np.array([name == WALL for name in self.model.partners(self.base)])
        return np.asarray((self.partner_of >= 0) & wall[self.partner_of])

    def scales(self, here: Tank | None, there: Tank | None) -> Floats:
        """Factors (R',) on rate constants that were measured `here` and are used `there`.

        ValueError: one of the tanks is not known, or a scaled rate constant is beyond what a float holds.
        """
        if there is None or here == there:
            return np.ones(self.base_of.size)
        if here is None:
            raise ValueError(f"rates were requested for a tank of {there}, but these rates do not state their tank")
        order = _totals(self.network.sparse_reactants)
        own = np.zeros(order.size) if self.base.rate_constants is None else self.base.rate_constants[self.base_of]
        with np.errstate(all="ignore"):
            factors = np.where(self._is_wall, here.wall_factor(there), here.dilution(there) ** (order - 1.0))
            lost = (own > 0.0) & ~((own * factors >= SMALLEST) & (own * factors < np.inf))
        if lost.any():
            channel = int(np.argmax(lost))
            raise ValueError(
                f"channel {self.network.channels[channel]!r}: its rate constant {own[channel]:g}, of a tank of {here}, "
                f"times {factors[channel]:g} for a tank of {there}, is beyond what a float holds; use tanks more alike"
            )
        return factors

    def constants(self, coefficients: ArrayLike, weights: ArrayLike) -> Floats:
        """Rate constants (..., R') from those of the base (..., R) and the weights (..., P) of the partners."""
        own = np.asarray(coefficients, dtype=float)[..., self.base_of]
        by_partner = np.asarray(weights, dtype=float)[..., self.partner_of]
        return np.where(self.partner_of < 0, own, own * by_partner)


def pairs(base: Network, model: BreakModel, states: ArrayLike) -> list[Floats]:
    """For each partner, the pairs (n, R) that it makes with the structure of each break, in states (n, S).

    Joins have none.

    >>> from dataclasses import replace
    >>> from kinetics import Network
    >>> from kinetics.rates.breaks import break_model, pairs
    >>> pair = replace(Network.from_text("2 A <-> AA, 0.01, 0.1"), conserved={"cubes": [1, 2]})
    >>> [table[0, 1].item() for table in pairs(pair, break_model("collision"), [[5, 3]])]  # AA with A, with another AA
    [15.0, 6.0]
    """
    counts = np.asarray(states)
    breaks = is_break(base)
    whole = np.where(breaks, base.combinations_of(counts), 0.0)
    taken = np.zeros((len(base.channels), len(base.species)), dtype=np.int64)
    needed = base.sparse_reactants
    taken[needed.rows, needed.columns] = needed.copies
    return [
        whole if name in (ALONE, WALL) else whole * (counts[:, [base.index(name)]] - taken[:, base.index(name)])
        for name in model.partners(base)
    ]


def _totals(table: SparseTable) -> Ints:
    total = np.zeros(table.shape[0], dtype=np.int64)
    np.add.at(total, table.rows, table.copies)
    return total
