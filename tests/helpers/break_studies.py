"""Synthetic calibration studies with known break models: SSA paths of the expanded line of four, seen on its base."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from synthetic_runs import line_network

from kinetics.network import Network, Tank
from kinetics.rates.breaks import BreakModel, Expansion, is_break
from kinetics.runs import JumpPath
from kinetics.sampling import sample_path
from tests.helpers.expanded_paths import on_base

TANK = Tank((2.0, 2.0, 3.0))
JOIN = 2e-4
CROWDS = ([0, 12, 4, 14], [30, 6, 4, 4], [10, 10, 10, 10], [4, 2, 4, 30])  # small partners and large ones


@dataclass(frozen=True, eq=False)
class KnownBreaks:
    """The truth of a study: a break model, its shape, and the coefficient of each break of the line of four.

    tank : in which the coefficients hold
    """

    law: BreakModel
    shape: Mapping[str, float]
    coefficients: tuple[float, ...]
    tank: Tank = TANK

    @property
    def base(self) -> Network:
        """The line of four with these coefficients."""
        base = line_network()
        constants = np.full(len(base.channels), JOIN)
        constants[is_break(base)] = self.coefficients
        return base.with_rates(constants)

    def network(self, tank: Tank) -> tuple[Expansion, Network]:
        """The expanded network in a tank, and where it comes from."""
        expansion = Expansion.of(self.base, self.law)
        constants = expansion.constants(self.base.known_rates, self.law.weights(self.base, self.shape))
        return expansion, expansion.network.with_rates(constants * expansion.scales(self.tank, tank))

    def runs(
        self, n: int, end: float, seed: int, tanks: Sequence[Tank] = (TANK,), first: int = 0
    ) -> tuple[JumpPath, ...]:
        """n runs until `end`, in these tanks and crowds by turns, on the base network."""
        made = {tank: self.network(tank) for tank in tanks}
        paths = []
        for i in range(first, first + n):
            tank = tanks[i % len(tanks)]
            expansion, network = made[tank]
            path = sample_path(network, CROWDS[(i // len(tanks)) % len(CROWDS)], end, seed=seed, run=i)
            paths.append(on_base(expansion, JumpPath(network, path.initial, path.times, path.channels, end, tank=tank)))
        return tuple(paths)


def by_first_coefficient(law: BreakModel, shape: Mapping[str, float], scale: float) -> KnownBreaks:
    """Coefficients in the ratios measured in the mechanics, 3.7, 7.9 and 13.5 for dimer, trimer and quadmer."""
    return KnownBreaks(law, shape, tuple((scale * np.array([3.7, 4.0, 3.4, 6.8])).tolist()))
