"""The collision model of breaks with a free weight for every species."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.network import Network
from kinetics.rates.breaks.base import BreakModel, ShapeParameter
from kinetics.support.arrays import Floats

MOST_SPECIES = 12  # with more, no run says anything of most weights


class CollisionSpecies(BreakModel):
    """X + Y -> parts + Y with a weight for every species Y, 1 for the first one.

    It asks nothing of sizes, and tests whether a power of the size, as in `Collision`, is good enough.

    >>> from kinetics import Network, break_model
    >>> pairs = Network.from_text("2 A <-> AA, 0.01, 0.1")
    >>> model = break_model("collision-species")
    >>> shape = {parameter.name: 3.0 for parameter in model.parameters(pairs)}
    >>> shape, model.weights(pairs, shape).tolist()
    ({'weight AA': 3.0}, [1.0, 3.0])
    """

    name = "collision-species"
    nested = "collision"

    def partners(self, network: Network) -> tuple[str, ...]:
        """Every species."""
        return network.species

    def parameters(self, network: Network) -> tuple[ShapeParameter, ...]:
        """The weights of all species but the first; a ValueError if they are too many."""
        if len(network.species) > MOST_SPECIES:
            raise ValueError(
                f"break model {self.name!r} has a weight a species, for up to {MOST_SPECIES}; this network has "
                f"{len(network.species)} species: use 'collision', whose weights follow from the sizes"
            )
        return tuple(ShapeParameter(f"weight {name}", 0.0, 1e3, is_weight=True) for name in network.species[1:])

    def weights(self, network: Network, shape: Mapping[str, float]) -> Floats:
        """Weights of the species as given, after 1 for the first."""
        return np.array([1.0, *(shape[f"weight {name}"] for name in network.species[1:])])
