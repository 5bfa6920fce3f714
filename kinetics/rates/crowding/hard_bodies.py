"""Contact values of hard bodies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.rates.crowding.base import CrowdingModel
from kinetics.support.arrays import Floats


class HardBodies(CrowdingModel):
    """Hard convex bodies touch more often than ideal points, by the contact value of their mixture; nothing is fitted.

    A body that touches another, or a wall, is shielded on that side, so others push it there. For spheres of radius R
    in a mixture the contact value is (1 + R z + (2/9) (R z)^2) / (1 - phi) at a wall, and with R_i R_j / (R_i + R_j) in
    the place of R for a pair (Boublik 1970, doi:10.1063/1.1673824; Mansoori, Carnahan, Starling & Leland 1971,
    doi:10.1063/1.1675048), written by mean radius of curvature and surface as for convex bodies. Walls keep bodies
    inside, see `ConvexBodies.room_of_pairs`.

    >>> from kinetics.rates.crowding import crowding_model
    >>> crowding_model("hard-bodies").terms([0.5], {}).round(3).tolist()
    [[0.0, 1.0, 0.5, 0.056]]
    """

    name = "hard-bodies"
    has_room = True

    def terms(self, contact: Floats, shape: Mapping[str, float]) -> Floats:  # noqa: ARG002
        """The powers of z in the contact value."""
        r = np.asarray(contact, dtype=float)
        return np.stack([np.zeros_like(r), np.ones_like(r), r, 2 / 9 * r**2], axis=-1)
