"""The base of all break models: which partners break a structure, and at which rate."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import numpy as np

from kinetics.network import Network
from kinetics.support.arrays import Floats

ALONE = ""  # in the place of a partner: the structure breaks by itself
WALL = "wall"


class ShapeParameter(NamedTuple):
    """A parameter that several channels share, such as an exponent: where its search starts, and its closed range.

    is_weight : it is compared with others by ratio, as the weight of a partner is; its range starts at 0

    >>> from kinetics.rates.breaks import ShapeParameter
    >>> alpha = ShapeParameter("alpha", low=-1.0, high=4.0)
    >>> alpha.value(0.5), alpha.unit(1.5)
    (1.5, 0.5)
    >>> round(ShapeParameter("wall", low=0.0, high=1e6, start=2.0, is_weight=True).value(0.5), 3)  # the median
    2.0
    """

    name: str
    low: float
    high: float
    start: float = 1.0
    is_weight: bool = False

    def value(self, unit: Floats | float) -> Floats | float:
        """The parameter at a quantile of its prior, 0 to 1; there searches and posteriors move.

        The prior is uniform on the range; that of a weight w is s / (s + w)^2 with its start s, as flat over ratios as
        a distribution with a median can be for small and large ones alike.
        """
        if not self.is_weight:
            return self.low + unit * (self.high - self.low)
        share = unit * self.high / (self.high + self.start)
        return self.start * share / (1 - share)

    def unit(self, value: float) -> float:
        """The quantile at which the parameter has a value; the inverse of `value`."""
        if not self.is_weight:
            return (value - self.low) / (self.high - self.low)
        return value / (value + self.start) * (self.high + self.start) / self.high


class SizeWeights(NamedTuple):
    """Weights of partners by nothing but their size: bodies (n,) of n sizes, the wall, and the structure alone.

    >>> import numpy as np
    >>> from kinetics.rates.breaks import break_model
    >>> found = break_model("collision").by_size(np.array([1.0, 4.0]), {"alpha": 0.5})
    >>> found.bodies.tolist(), found.wall, found.alone
    ([1.0, 2.0], 0.0, 0.0)
    """

    bodies: Floats
    wall: float = 0.0
    alone: float = 0.0


class BreakModel(ABC):
    """A model of breaks: the partners that break a structure X, and the weight of each.

    propensity of break c of X = b_c * N_c * sum over partners Y of w_Y * (pairs of X with Y)

    b_c : the channel's own coefficient, 1/tu per way and partner of weight 1, in the tank of the rates
    w_Y : weight of a partner, from shape parameters that all breaks share
    pairs : x y; x (x - 1) for like bodies, because either copy may break; x for a wall, or for a structure alone

    Meetings of bodies scale with 1 / volume, hits on a wall with surface / volume.

    To add a model:
    1. write a class with a `name`, whose docstring states its assumption and its source;
    2. give `partners`, `parameters` if it has any, and `weights`; if these depend on sizes alone, `by_size`, so
        that class rates and network-free runs can use it;
    3. import it in `kinetics.rates.breaks.models`: command lines, estimation, prediction and
       tests/contracts/test_breaks.py read the tuple made there.

    >>> from dataclasses import replace
    >>> from kinetics import Network, break_model
    >>> pairs = replace(Network.from_text("2 A <-> AA, 0.01, 0.1"), conserved={"cubes": [1, 2]})
    >>> break_model("collision").partners(pairs)
    ('A', 'AA')
    >>> break_model("collision").weights(pairs, {"alpha": 1.5}).round(3).tolist()
    [1.0, 2.828]
    """

    name: ClassVar[str]
    nested: ClassVar[str | None] = None  # the model of which this one is an extension, for likelihood-ratio tests

    @abstractmethod
    def partners(self, network: Network) -> tuple[str, ...]:
        """P names: species, `WALL`, or `ALONE`."""

    def parameters(self, network: Network) -> tuple[ShapeParameter, ...]:  # noqa: ARG002
        """The shape parameters; none if the weights are known."""
        return ()

    @abstractmethod
    def weights(self, network: Network, shape: Mapping[str, float]) -> Floats:
        """Weights (P,) >= 0 of the partners at these values of the shape parameters."""

    @property
    def size_parameters(self) -> tuple[ShapeParameter, ...]:
        """The shape parameters of `by_size`; none by default."""
        return ()

    def by_size(self, sizes: Floats, shape: Mapping[str, float]) -> SizeWeights:  # noqa: ARG002
        """The weights of bodies of these sizes (n,), whatever network they belong to.

        ValueError: weights of this model are not given by sizes.
        """
        raise ValueError(
            f"break model {self.name!r} weights partners by species, which differ between books: use one that "
            f"weights them by size, such as 'collision'"
        )


def body_sizes(network: Network) -> Floats:
    """Parts (S,) in a body of each species: its one conserved quantity.

    ValueError if the network has none, or several.
    """
    if len(network.conserved) != 1:
        known = ", ".join(network.conserved) or "none"
        raise ValueError(
            f"weights by size need one conserved quantity, the parts in each species; the network has {known}: "
            "use the break model 'first-order', or give one by dataclasses.replace(network, conserved=...)"
        )
    (sizes,) = network.conserved.values()
    if not (sizes > 0).all():
        names = [network.species[s] for s in np.flatnonzero(sizes <= 0)]
        raise ValueError(f"{', '.join(names)} without parts; weights by size need at least one in every species")
    return sizes
