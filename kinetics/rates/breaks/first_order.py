"""The first-order break model: bonds break whatever else is in the tank."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.network import Network
from kinetics.rates.breaks.base import ALONE, BreakModel, SizeWeights
from kinetics.support.arrays import Floats


class FirstOrder(BreakModel):
    """A structure breaks at a constant rate, whatever else is in the tank, as the paper assumes (table III).

    >>> from kinetics import Network, break_model
    >>> pairs = Network.from_text("2 A <-> AA, 0.01, 0.1")
    >>> break_model("first-order").partners(pairs) == ("",), break_model("first-order").weights(pairs, {}).tolist()
    (True, [1.0])
    """

    name = "first-order"

    def partners(self, network: Network) -> tuple[str, ...]:  # noqa: ARG002
        """The structure is alone."""
        return (ALONE,)

    def weights(self, network: Network, shape: Mapping[str, float]) -> Floats:  # noqa: ARG002
        """The only weight, 1: a break needs no partner."""
        return np.ones(1)

    def by_size(self, sizes: Floats, shape: Mapping[str, float]) -> SizeWeights:  # noqa: ARG002
        """Bodies do not matter."""
        return SizeWeights(np.zeros(np.shape(sizes)), alone=1.0)
