"""No crowding: mass action."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.rates.crowding.base import CrowdingModel
from kinetics.support.arrays import Floats


class NoCrowding(CrowdingModel):
    """Rates do not depend on other bodies, as the paper assumes.

    >>> from kinetics.rates.crowding import crowding_model
    >>> crowding_model("none").terms([0.5], {}).tolist()
    [[1.0]]
    """

    name = "none"

    def terms(self, contact: Floats, shape: Mapping[str, float]) -> Floats:  # noqa: ARG002
        """One."""
        return np.ones((len(contact), 1))
