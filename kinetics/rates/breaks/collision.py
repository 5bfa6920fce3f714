"""The collision model of breaks: other bodies break a structure, the larger ones more."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.network import Network
from kinetics.rates.breaks.base import BreakModel, ShapeParameter, SizeWeights, body_sizes
from kinetics.support.arrays import Floats

EXPONENT = ShapeParameter("alpha", -1.0, 4.0, 1.0)


class Collision(BreakModel):
    """X + Y -> parts + Y with weight size(Y)^alpha, for every species Y.

    The weight holds both how often a partner of that size comes and how hard it hits. Bodies alike in every other way
    would come with an exponent between 0 and 1; heavy partners hit harder, which adds to it.

    >>> from dataclasses import replace
    >>> from kinetics import Network, break_model
    >>> pairs = replace(Network.from_text("2 A <-> AA, 0.01, 0.1"), conserved={"cubes": [1, 2]})
    >>> break_model("collision").partners(pairs), break_model("collision").weights(pairs, {"alpha": 2.0}).tolist()
    (('A', 'AA'), [1.0, 4.0])
    """

    name = "collision"

    def partners(self, network: Network) -> tuple[str, ...]:
        """Every species."""
        return network.species

    def parameters(self, network: Network) -> tuple[ShapeParameter, ...]:  # noqa: ARG002
        """The exponent alpha of the size dependence."""
        return self.size_parameters

    def weights(self, network: Network, shape: Mapping[str, float]) -> Floats:
        """The sizes to the power of alpha; 1 for a single part."""
        return self.by_size(body_sizes(network), shape).bodies

    @property
    def size_parameters(self) -> tuple[ShapeParameter, ...]:
        """The exponent alpha of the size dependence."""
        return (EXPONENT,)

    def by_size(self, sizes: Floats, shape: Mapping[str, float]) -> SizeWeights:
        """The sizes to the power of alpha."""
        return SizeWeights(np.asarray(sizes, dtype=float) ** shape["alpha"])
