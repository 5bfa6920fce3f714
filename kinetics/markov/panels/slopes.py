"""How rates and observations depend on the parameters of a model: d ln(rate) / d ln(parameter)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints

STEP = 1e-5  # of the logarithm of a parameter, to both sides; the error of a slope is about 1e-10


class Slopes:
    """The slopes of P parameters at a point.

    names : parameters of the network, channels, or columns of data
    value_of : what a parameter of the network is at the point
    at : the network with a parameter of another value
    columns : place among the names -> column, of those that belong to an observation

    The constant of a channel changes its rate in proportion; on any other parameter rates depend as formulas say, so
    they are evaluated on both sides.
    """

    def __init__(
        self,
        network: Network,
        names: Sequence[str],
        columns: Mapping[int, int],
        value_of: Callable[[str], float],
        at: Callable[[str, float], Network],
    ) -> None:
        self.size, self.columns = len(names), columns
        rest = {p: name for p, name in enumerate(names) if p not in columns}
        self._channels = {p: network.channel_places[name] for p, name in rest.items() if name in network.channel_places}
        self._sides = {
            p: [at(name, value_of(name) * np.exp(sign * STEP)) for sign in (-1, 1)]
            for p, name in rest.items()
            if p not in self._channels
        }

    def of_rates(self, states: Ints, rows: Ints, channels: Ints) -> Floats:
        """Slopes (P, K) of the rates of channels (K,) in the states (N, S) with places rows (K,)."""
        found = np.zeros((self.size, rows.size))
        for p, channel in self._channels.items():
            found[p] = channels == channel
        for p, sides in self._sides.items():
            low, high = (side.propensities(states)[rows, channels] for side in sides)
            happens = (low > 0) & (high > 0)
            found[p, happens] = np.log(high[happens] / low[happens]) / (2.0 * STEP)
        return found
