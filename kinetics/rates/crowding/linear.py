"""Rates that grow with the density of bodies, by a factor that is fitted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.rates.breaks import ShapeParameter
from kinetics.rates.crowding.base import CrowdingModel
from kinetics.support.arrays import Floats


class Linear(CrowdingModel):
    """1 + c z / (1 - phi), the first term of any law, with one c for bodies of all sizes.

    c : a length

    >>> from kinetics.rates.crowding import crowding_model
    >>> crowding_model("linear").terms([0.5], {"c": 0.2}).tolist()
    [[1.0, 0.0, 0.2]]
    """

    name = "linear"
    parameters = (ShapeParameter("c", 0.0, 100.0, 0.1, is_weight=True),)

    def terms(self, contact: Floats, shape: Mapping[str, float]) -> Floats:
        """One, and c on z."""
        return np.tile([1.0, 0.0, shape["c"]], (len(contact), 1))
