"""Candidate tanks of a calibration: compositions that the assembly passes through, and what a run in each shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.planning.forecast import Forecast, whole_bodies
from kinetics.network import Network
from kinetics.rates.breaks import is_break
from kinetics.support.arrays import Floats
from kinetics.support.cli.progress import stage


@dataclass(frozen=True, eq=False)
class Candidate:
    """Tanks alike.

    composition : species -> copies at time 0
    along : time on the predicted path at which the composition is expected, tu
    events : (R,) expected in a run, by channel of the rule book
    """

    composition: dict[str, int]
    along: float
    events: Floats


def candidates(
    forecast: Forecast,
    starts: Sequence[Mapping[str, int]],
    sizes: ArrayLike,
    along: Sequence[float],
    duration: float,
) -> list[Candidate]:
    """Tanks on the predicted path from each start, at rising times `along`, each composition once.

    sizes : (S,) parts in a body of each species; duration : of a run, tu
    """
    found: list[Candidate] = []
    network = forecast.network
    for start in starts:
        for time, mean in zip(along, forecast.composition(network.state(start), along), strict=True):
            counts = whole_bodies(mean, sizes)
            composition = {name: int(n) for name, n in zip(network.species, counts, strict=True) if n}
            if all(composition != other.composition for other in found):
                stage(f"events of tank {len(found) + 1}, at {time:g} tu")
                found.append(Candidate(composition, float(time), forecast.events(counts, duration)))
    return found


def wanted_rates(network: Network, each_break: bool = False) -> dict[str, NDArray[np.bool_]]:
    """The rates to measure, name -> channels (R,) bool: every join, and all breaks together or each of them."""
    breaks = is_break(network)
    alone = [r for r in range(breaks.size) if each_break or not breaks[r]]
    groups = {network.channels[r]: np.arange(breaks.size) == r for r in alone}
    return groups if each_break or not breaks.any() else groups | {"breaks": breaks}
