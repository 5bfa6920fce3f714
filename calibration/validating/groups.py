"""Simulated groups: what as many runs as were held out would show, each group under its own draw of the rates.

Draw d has the same rate constants in every experiment of a study, as one calibration serves them all; the runs of
different experiments share no random numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibration.estimating.joins_and_breaks import joins_and_breaks
from kinetics.network import Model, Network, Tank
from kinetics.rates import Rates
from kinetics.sampling import Direct, exposures_of_draws, simulate_posterior
from kinetics.support.arrays import Floats, Ints

BLOCK = 2000  # draws that come from one random stream
# First run number of each part of an experiment; no part makes as many runs as lie between two of them.
EXPERIMENT, GROUPS, FIRST_TIMES, OFF = 2**40, 2**36, 2**37, 2**38


def event_groups(network: Network) -> dict[str, tuple[str, ...]]:
    """All joins, all breaks, then every channel by itself: name -> channels."""
    names = np.array(network.channels, dtype=object)
    wholes = {group: tuple(names[members]) for group, members in joins_and_breaks(network).items()}
    return wholes | {name: (name,) for name in network.channels if name not in wholes}


@dataclass(frozen=True, eq=False)
class SimulatedGroups:
    """Groups of `runs` runs each, from one initial state.

    network : the derived network; rates : their posterior is drawn from
    initial : (S,) counts; runs : n
    number : of the experiment in its study
    tank : that of the runs; None if it is not known, which is then that of the rates
    """

    network: Network
    rates: Rates
    initial: Ints
    runs: int
    seed: int
    number: int = 0
    tank: Tank | None = None

    @cached_property
    def model(self) -> Network:
        """The network that is simulated, at the posterior mean of each rate constant."""
        return self.rates.expected(self.network, self.tank)

    @cached_property
    def _start(self) -> Model:
        return Model.of(self.model, self.initial)

    @cached_property
    def mean_constants(self) -> Floats:
        """Posterior means (R,) of the rate constants."""
        return self.model.known_rates

    def first_run(self, part: int) -> int:
        """Number of the first run of a part of this experiment, such as GROUPS."""
        return self.number * EXPERIMENT + part

    def constants(self, begin: int, end: int) -> Floats:
        """Rate constants (end - begin, R) of these draws."""
        blocks = [self._block(b) for b in range(begin // BLOCK, -(-end // BLOCK))]
        skipped = begin - begin % BLOCK
        return np.concatenate(blocks)[begin - skipped : end - skipped]

    def _block(self, b: int) -> Floats:
        rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(1, b)))
        return self.rates.draw_constants(self.network, rng, BLOCK, self.tank)

    def counts(self, groups: int, times: Floats) -> np.ndarray:
        """Counts (groups, n, T, S) of the first groups; int32, which halves the memory."""
        counts = np.empty((groups, self.runs, times.size, len(self.model.species)), dtype=np.int32)
        made = simulate_posterior(
            self._start, self.constants(0, groups), times, self.runs, self.seed,
            method=Direct(), first_run=self.first_run(GROUPS),
        )  # fmt: skip
        for group, drawn in zip(counts, made, strict=True):
            group[:] = drawn
        return counts

    def events(self, begin: int, end: int, until: float) -> Iterator[tuple[Ints, Floats]]:
        """Events and exposures (n, R) of the groups begin to end, until a time, tu; see `exposures_of_draws`."""
        return exposures_of_draws(
            self._start, self.constants(begin, end), until, self.runs, self.seed,
            first_run=self.first_run(GROUPS) + begin * self.runs,
        )  # fmt: skip

    def events_off(self, factors: Floats, groups: int, until: float, part: int) -> Iterator[tuple[Ints, Floats]]:
        """Events and exposures (n, R) of other runs, whose rate constants are multiplied by factors (R,).

        part : number of this set of runs among those of the experiment; it selects their random streams
        """
        return exposures_of_draws(
            self._start, self.constants(0, groups) * factors, until, self.runs, self.seed,
            first_run=self.first_run(OFF) + part * groups * self.runs,
        )  # fmt: skip
