"""The collision model of breaks with walls: other bodies and the walls break a structure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.network import Network
from kinetics.rates.breaks.base import WALL, BreakModel, ShapeParameter, SizeWeights, body_sizes
from kinetics.rates.breaks.collision import EXPONENT
from kinetics.support.arrays import Floats


class CollisionWall(BreakModel):
    """X + Y -> parts + Y with weight size(Y)^alpha for every species Y, and X -> parts at the walls.

    The walls count as one more partner, of weight `wall` in the tank of the rates: as many single parts as would break
    structures as often. One weight for all structures supposes that what a wall breaks, a body breaks in proportion.

    >>> from dataclasses import replace
    >>> from kinetics import Network, break_model
    >>> pairs = replace(Network.from_text("2 A <-> AA, 0.01, 0.1"), conserved={"cubes": [1, 2]})
    >>> model = break_model("collision-wall")
    >>> model.partners(pairs), model.weights(pairs, {"alpha": 2.0, "wall": 50.0}).tolist()
    (('A', 'AA', 'wall'), [1.0, 4.0, 50.0])
    """

    name = "collision-wall"
    nested = "collision"

    def partners(self, network: Network) -> tuple[str, ...]:
        """Every species, and the wall."""
        return (*network.species, WALL)

    def parameters(self, network: Network) -> tuple[ShapeParameter, ...]:  # noqa: ARG002
        """The exponent alpha and the weight of the walls."""
        return self.size_parameters

    def weights(self, network: Network, shape: Mapping[str, float]) -> Floats:
        """The sizes to the power of alpha, then the weight of the walls."""
        bodies, wall, _ = self.by_size(body_sizes(network), shape)
        return np.append(bodies, wall)

    @property
    def size_parameters(self) -> tuple[ShapeParameter, ...]:
        """The exponent alpha and the weight of the walls."""
        return (EXPONENT, ShapeParameter("wall", 0.0, 1e4, 30.0, is_weight=True))

    def by_size(self, sizes: Floats, shape: Mapping[str, float]) -> SizeWeights:
        """The sizes to the power of alpha, and the weight of the walls."""
        return SizeWeights(np.asarray(sizes, dtype=float) ** shape["alpha"], wall=shape["wall"])
