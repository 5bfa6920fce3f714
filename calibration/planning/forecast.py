"""Forecasts of runs under known rates: compositions over time, and numbers of events."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network import Model, Network, Tank
from kinetics.rates import Rates
from kinetics.rates.breaks import Expansion
from kinetics.runs import JumpPath
from kinetics.sampling import exposures_of_draws, sample_path
from kinetics.support.arrays import Floats, Ints, rising_times

DRAWS = 100


@dataclass(frozen=True, eq=False)
class Forecast:
    """Exact SSA runs, each under its own draw from the posterior of pilot rates.

    expansion : network of the rule book (R channels), and what the break model makes of it (R' channels)
    constants : (D, R') draws of the rate constants in the tank of the runs, 1/tu
    seed : of the runs
    """

    expansion: Expansion
    constants: Floats
    seed: int = 0

    @classmethod
    def of(cls, rates: Rates, network: Network, tank: Tank | None = None, draws: int = DRAWS, seed: int = 0) -> Self:
        """The forecast by pilot rates for runs in `tank`; None: the tank in which the rates were measured.

        ValueError: rates of another network, or another tank than theirs, which they do not state.
        """
        rng = np.random.default_rng(seed)
        expansion = rates.crowded(rates.expansion(network), tank)
        return cls(expansion, rates.draw_constants(network, rng, draws, tank), seed)

    def scaled(self, factors: ArrayLike) -> Self:
        """A copy of the forecast with the rates of each channel of the rule book multiplied by `factors` (R,)."""
        return replace(self, constants=self.constants * np.asarray(factors, dtype=float)[self.expansion.base_of])

    @property
    def network(self) -> Network:
        """The network of the rule book, with one channel a break."""
        return self.expansion.base

    def paths(self, initial: ArrayLike, end: float) -> Iterator[JumpPath]:
        """One run of each draw."""
        for draw, row in enumerate(self.constants):
            yield sample_path(self.expansion.network.with_rates(row), initial, end, seed=self.seed, run=draw)

    def composition(self, initial: ArrayLike, times: ArrayLike) -> Floats:
        """Mean counts (T, S) at rising `times`, tu."""
        grid = rising_times(np.asarray(times, dtype=float))
        at_times = [
            path.states[np.searchsorted(path.times, grid, side="right")]
            for path in self.paths(initial, max(float(grid[-1]), 1e-9))
        ]
        return np.asarray(np.mean(at_times, axis=0))

    def events(self, initial: ArrayLike, duration: float) -> Floats:
        """Expected events (R,) of each channel of the rule book in one run of `duration` tu that is not restarted.

        The mean of rate constant times exposure, whose scatter is less than that of the events themselves. Reactants
        that are used up are not there any more: the exposure is that of the whole run.
        """
        total = np.zeros(len(self.network.channels))
        start = Model.of(self.expansion.network.with_rates(self.constants[0]), initial)
        made = exposures_of_draws(start, self.constants, duration, runs=1, seed=self.seed)
        for row, (_, (exposures,)) in zip(self.constants, made, strict=True):
            np.add.at(total, self.expansion.base_of, row * exposures)
        return total / len(self.constants)


def whole_bodies(mean: ArrayLike, sizes: ArrayLike) -> Ints:
    """Whole counts (S,) near mean counts (S,), of as many parts in all, by largest remainder.

    sizes : parts in a body of each species; one of them is 1, so that no part is left over

    >>> whole_bodies([0.5, 1.5, 0.5], [1, 2, 3])
    array([1, 2, 0])
    """
    wanted, parts = np.asarray(mean, dtype=float), np.asarray(sizes, dtype=float)
    counts = np.floor(wanted + 1e-9)
    left = round(float((wanted - counts) @ parts))
    remainders = wanted - counts
    while left > 0:
        fits = parts <= left
        if not fits.any():
            raise ValueError(f"{left} parts are left over, and no species is as small; expected one of size 1")
        chosen = int(np.argmax(np.where(fits, remainders, -np.inf)))
        counts[chosen] += 1
        remainders[chosen] -= 1
        left -= int(parts[chosen])
    return counts.astype(np.int64)
