"""The data of diagnostics: runs, and the clock of every channel's hazard under a model of rates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.diagnosing.hazards import Elapsed, elapsed_of, hazard_of
from calibration.estimating.exposure import Sojourns, require_same, sojourns
from calibration.estimating.rate_fit import RateFit
from kinetics.network import Network
from kinetics.rates import Rates
from kinetics.rates.breaks import is_break
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats, Ints, integers


class Clocked(NamedTuple):
    """One run on the clocks of its channels.

    stretches : from one event or restart to the next
    level : (E + 1, R) hazard of each channel in each stretch, per unit of `elapsed`, up to a factor a channel
    elapsed : integral of the model's speed from `begin` to `end`, (E + 1,) tu; its shape broadcasts to that of level
    """

    path: JumpPath
    stretches: Sojourns
    level: Floats
    elapsed: Elapsed

    @property
    def passed(self) -> Floats:
        """Integrated hazard (E + 1, R) of each channel in each stretch."""
        return self.level * self.elapsed(self.stretches.begin, self.stretches.end)

    def passed_between(self, begin: Floats, end: Floats) -> Floats:
        """Integrated hazard (E + 1, R) in the part of each stretch that lies between `begin` and `end` (E + 1,), tu."""
        first = np.clip(begin, self.stretches.begin, self.stretches.end)
        last = np.clip(end, first, self.stretches.end)
        return self.level * self.elapsed(first, last)

    @property
    def fired(self) -> Ints:
        """Rows (n,) at which a channel fired; restarts are left out."""
        return np.flatnonzero(self.path.channels != RESTART)


@dataclass(frozen=True, eq=False)
class DiagnosedRuns:
    """Runs of one network, and the model of rates under which they are judged.

    fit : a model fitted to all channels or some, rates as predictions use them, or None for mass action
    bonds : per run (E, 2), the two cubes whose faces met or parted at each event, -1 if that is not known
    seed : of the random numbers by which some p-values are computed
    """

    runs: tuple[JumpPath, ...]
    fit: RateFit | Rates | None = None
    bonds: tuple[Ints, ...] | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.runs:
            raise ValueError("no runs to diagnose; give at least one path")
        for path in self.runs:
            require_same(self.network, path.network)
        if self.bonds is None:
            return
        if len(self.bonds) != len(self.runs):
            raise ValueError(f"bonds of {len(self.bonds)} runs; expected one array for each of {len(self.runs)} paths")
        for i, (path, bonds) in enumerate(zip(self.runs, self.bonds, strict=True)):
            integers(f"bonds[{i}]", bonds, (path.times.size, 2), minimum=-1)

    @property
    def network(self) -> Network:
        """The network of all runs."""
        return self.runs[0].network

    @cached_property
    def clocked(self) -> tuple[Clocked, ...]:
        """Every run on the clocks of its channels, whose events then are Poisson processes of constant rate."""
        return tuple(self._clocked())

    def _clocked(self) -> Iterator[Clocked]:
        hazard = hazard_of(self.fit, self.network, self.runs[0].tank)
        for path in self.runs:
            stretches = sojourns(path)
            elapsed = elapsed_of(self.fit, stretches, self.network)
            yield Clocked(path, stretches, hazard(path) * path.open_channels, elapsed)

    @cached_property
    def events(self) -> Ints:
        """(R,) firings of each channel in all runs."""
        n = len(self.network.channels)
        return sum((np.bincount(c.path.channels[c.fired], minlength=n) for c in self.clocked), np.zeros(n, np.int64))

    @cached_property
    def exposure(self) -> Floats:
        """(R,) integrated hazard of each channel in all runs, up to a factor a channel."""
        return np.asarray(np.sum([c.passed.sum(axis=0) for c in self.clocked], axis=0))

    def random(self, *keys: object) -> np.random.Generator:
        """Random numbers of their own for each test and channel."""
        return np.random.default_rng([self.seed, crc32(repr(keys).encode())])

    @cached_property
    def breaks(self) -> NDArray[np.bool_]:
        """(R,) the channels that are breaks."""
        return is_break(self.network)

    def amount(self, states: Ints) -> Floats:
        """Matter (n,) in states (n, S): the one conserved quantity, or the copies of all species."""
        if len(self.network.conserved) == 1:
            (weights,) = self.network.conserved.values()
            return states @ weights
        return np.asarray(states.sum(axis=1), dtype=np.float64)

    @property
    def matter(self) -> str:
        """The name of the matter that `amount` counts."""
        return next(iter(self.network.conserved)) if len(self.network.conserved) == 1 else "copies"

    def grouped(self, groups: Sequence[Ints], n: int) -> tuple[Ints, Floats]:
        """Events and exposure (n, R) by group, of which each run names one (E + 1,) a stretch."""
        events, exposure = np.zeros((n, self.events.size), np.int64), np.zeros((n, self.events.size))
        for clocked, group in zip(self.clocked, groups, strict=True):
            np.add.at(exposure, group, clocked.passed)
            np.add.at(events, (group[clocked.fired], clocked.path.channels[clocked.fired]), 1)
        return events, exposure
