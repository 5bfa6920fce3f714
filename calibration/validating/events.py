"""Events seen in held-out runs beside those expected, group by group of channels, with predictive p-values.

What is expected is rate times exposure, summed over the channels of a group and over the runs: the events that the
rates promise in the states that these runs were in. The number of events alone says little where an assembly runs to
its end, for then it hardly depends on the rates. What is ranked among simulated groups is seen / expected, where the
simulated groups have their own states, events and draws of the rates: so the p-value carries the noise of the runs
and the uncertainty of the calibration, and keeps its level where model and posterior hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.joins_and_breaks import WHOLES
from calibration.validating.groups import SimulatedGroups, event_groups
from calibration.validating.predictive import looks, sequential_p
from calibration.validating.scores import Counts, central_band
from kinetics.network import Network, Tank
from kinetics.rates.breaks import base_channel
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats, Ints, divided
from kinetics.support.cli.progress import stage

LEVEL = 0.95
AT_A_TIME = 500  # groups whose single runs are in memory


@dataclass(frozen=True)
class EventRow:
    """One group of channels at one size, or over all sizes.

    size : the experiment as text
    cubes : of a run; None for the pooled rows of all sizes
    tank : edges of the tank, where it is known
    engine : that made the runs, where it is known
    group : `joins`, `breaks`, or a channel
    seen, expected : events of all runs; what the posterior means of the rates give over the exposures of these runs
    low, high : 95 % predictive interval of the events, given these exposures
    p, least : two-sided predictive p-value, and the smallest that the simulated groups could give
    scatter : Pearson's dispersion of the events between runs, about 1 under the model; nan for a single run
    scatter_low, scatter_high, p_scatter, least_scatter : as above
    """

    size: str
    cubes: int | None
    tank: tuple[float, ...] | None
    engine: str | None
    group: str
    seen: int
    expected: float
    low: float
    high: float
    p: float
    least: float
    scatter: float
    scatter_low: float
    scatter_high: float
    p_scatter: float
    least_scatter: float

    def to_dict(self) -> dict[str, object]:
        """The row, without what only says how finely its p-values are resolved."""
        return {name: value for name, value in vars(self).items() if not name.startswith("least")}


@dataclass(frozen=True, eq=False)
class EventTotals:
    """Totals of D groups of runs in G groups of channels, arrays (D, G).

    seen, expected : events, and those expected over the exposures
    chi_squared : of the events of the runs about their common seen / expected, with `freedom` = n - 1
    """

    seen: Ints
    expected: Floats
    chi_squared: Floats
    freedom: int

    @property
    def ratio(self) -> Floats:
        """seen / expected (D, G); 0 if neither is, inf if events came that the rates call impossible."""
        known = self.expected > 0
        nothing = np.where(self.seen > 0, np.inf, 0.0)
        return np.divide(self.seen, self.expected, out=nothing, where=known)

    @property
    def scatter(self) -> Floats:
        """Pearson's dispersion (D, G); nan for a single run."""
        return self.chi_squared / self.freedom if self.freedom else np.full(self.chi_squared.shape, np.nan)

    @classmethod
    def of(cls, events: Ints, expected: Floats) -> EventTotals:
        """Totals from each run's events and expected events (D, n, G)."""
        seen, total = events.sum(axis=1), expected.sum(axis=1)
        factor = divided(seen, total)
        fitted = expected * factor[:, None]
        squares = divided((events - fitted) ** 2, fitted)
        return cls(seen, total, squares.sum(axis=1), events.shape[1] - 1)

    @classmethod
    def joined(cls, parts: Sequence[EventTotals]) -> EventTotals:
        """Groups of runs one after the other."""
        return cls(
            np.concatenate([part.seen for part in parts]),
            np.concatenate([part.expected for part in parts]),
            np.concatenate([part.chi_squared for part in parts]),
            parts[0].freedom,
        )

    def until(self, groups: int) -> EventTotals:
        """The totals of the first groups only."""
        return EventTotals(self.seen[:groups], self.expected[:groups], self.chi_squared[:groups], self.freedom)

    @classmethod
    def pooled(cls, parts: Sequence[EventTotals]) -> EventTotals:
        """Events of several experiments summed by group; the scatter is about each experiment's own seen / expected."""
        return cls(
            np.sum([part.seen for part in parts], axis=0),
            np.sum([part.expected for part in parts], axis=0),
            np.sum([part.chi_squared for part in parts], axis=0),
            sum(part.freedom for part in parts),
        )


@dataclass(frozen=True, eq=False)
class HeldOutEvents:
    """Events of n held-out runs until a time, and of simulated groups of n runs.

    names : of the G groups of channels
    seen : (n, G) events of the held-out runs
    exposures : (n, R) of the simulated network's channels in these runs, tu
    first, most : numbers of groups simulated at first, and at most, where a p-value is small
    """

    groups: SimulatedGroups
    until: float
    names: tuple[str, ...]
    seen: Ints
    exposures: Floats
    first: int
    most: int

    @classmethod
    def of(
        cls, groups: SimulatedGroups, paths: Sequence[JumpPath], until: float, first: int, most: int
    ) -> HeldOutEvents:
        """Count the events of `paths` until a time, tu, none of which ends before it."""
        names, members = _membership(groups.network, groups.network.channels)
        cut = [_until(path, until) for path in paths]
        seen = np.array([np.bincount(path.channels, minlength=len(path.network.channels)) for path in cut])
        exposures = np.array([_exposures(path, groups.model) for path in cut])
        return cls(groups, until, names, seen @ members, exposures, first, most)

    @cached_property
    def expected(self) -> Floats:
        """Events (n, G) expected in the held-out runs."""
        return self.exposures * self.groups.mean_constants @ self._members

    def expected_by_draw(self, group: str, draws: int) -> Floats:
        """Events (draws,) of a group of channels that each draw of the rates expects in all held-out runs together."""
        members = self._members[:, self.names.index(group)]
        return np.asarray(self.groups.constants(0, draws) @ (self.exposures.sum(axis=0) * members))

    @cached_property
    def observed(self) -> EventTotals:
        """The totals of the held-out runs, D = 1."""
        return EventTotals.of(self.seen[None], self.expected[None])

    @cached_property
    def first_runs(self) -> tuple[Ints, Floats]:
        """Events and expected events (first, n, G) of every run of the groups simulated at first."""
        pieces = list(self._grouped(self.groups.events(0, self.first, self.until)))
        events, expected = zip(*pieces, strict=True)
        return np.array(events), np.array(expected)

    @cached_property
    def first_totals(self) -> EventTotals:
        """The totals of the groups simulated at first."""
        return EventTotals.of(*self.first_runs)

    @cached_property
    def looks(self) -> tuple[int, ...]:
        """Numbers of groups after which p-values are looked at."""
        return looks(self.first, self.most)

    def totals(self, groups: int) -> EventTotals:
        """The totals of the first groups, as many as one of the `looks`; they are simulated once."""
        while (known := sum(len(part.seen) for part in self._parts)) < groups:
            stage(f"{known} of {groups} simulated groups of runs")
            self._parts.append(self._totals(self.groups.events(known, groups, self.until)))
        return EventTotals.joined(self._parts).until(groups)

    @cached_property
    def _parts(self) -> list[EventTotals]:
        """The totals of the groups simulated so far."""
        return [self.first_totals]

    @property
    def tank(self) -> Tank | None:
        """The tank of the runs; None if it is not known."""
        return self.groups.tank

    def run_values(
        self, counts: Ints, simulated: Counts, species: Sequence[str]
    ) -> tuple[tuple[str, ...], Floats, Floats]:
        """The figures that single runs are judged by: joins, breaks and final counts, seen and simulated.

        counts, simulated : (n, S) and (first, n, S) at the end. Returns names, and values (n, Q) and (first, n, Q), in
        which events are divided by the expected number.
        """
        pooled = [g for g, name in enumerate(self.names) if name in WHOLES]
        names = (*(self.names[g] for g in pooled), *species)
        values = []
        for events, expected, final in ((self.seen, self.expected, counts), (*self.first_runs, simulated)):
            ratio = divided(events, expected)
            values.append(np.concatenate([ratio[..., pooled], final], axis=-1))
        return names, values[0], values[1]

    def totals_off(self, group: str, factor: float, groups: int, part: int) -> EventTotals:
        """Totals of groups of runs whose rates of one group of channels are `factor` times those calibrated."""
        stage(f"power to show {group} off by a factor of {factor:g}")
        factors = np.where(self._members[:, self.names.index(group)] > 0, factor, 1.0)
        return self._totals(self.groups.events_off(factors, groups, self.until, part))

    def _totals(self, made: Iterator[tuple[Ints, Floats]]) -> EventTotals:
        grouped, parts = self._grouped(made), []
        while piece := list(islice(grouped, AT_A_TIME)):
            events, expected = zip(*piece, strict=True)
            parts.append(EventTotals.of(np.array(events), np.array(expected)))
        return EventTotals.joined(parts)

    def _grouped(self, made: Iterator[tuple[Ints, Floats]]) -> Iterator[tuple[Ints, Floats]]:
        """Events and expected events (n, G), from events and exposures (n, R) of the model's channels."""
        weights = self.groups.mean_constants[:, None] * self._members
        for events, exposures in made:
            yield events @ self._members, exposures @ weights

    @cached_property
    def _members(self) -> Ints:
        """(R, G) 1 if a channel of the simulated network is in a group."""
        return _membership(self.groups.network, self.groups.model.channels)[1]


def event_rows(
    held_out: Sequence[HeldOutEvents],
    size: str,
    cubes: int | None = None,
    tank: Tank | None = None,
    engine: str | None = None,
) -> tuple[EventRow, ...]:
    """A row for each group of channels: of one experiment, or of several pooled.

    First some 2,000 groups are simulated, then twice as many while a p-value has fewer than five groups on its side,
    to 9,999 at most, see `sequential_p`.
    """
    observed = EventTotals.pooled([each.observed for each in held_out])
    numbers = held_out[0].looks

    @cache
    def totals(groups: int) -> EventTotals:
        return EventTotals.pooled([each.totals(groups) for each in held_out])

    first = totals(numbers[0])
    p, least = sequential_p(observed.ratio[0], numbers, lambda n: totals(n).ratio)
    low, high = central_band(first.ratio, LEVEL)
    p_scatter = least_scatter = scatter_low = scatter_high = np.full(p.shape, np.nan)
    if observed.freedom:
        p_scatter, least_scatter = sequential_p(observed.scatter[0], numbers, lambda n: totals(n).scatter)
        scatter_low, scatter_high = central_band(first.scatter, LEVEL)
    expected = observed.expected[0]
    return tuple(
        EventRow(
            size, cubes, tank.size if tank else None, engine, name, int(observed.seen[0, g]), float(expected[g]),
            float(expected[g] * low[g]), float(expected[g] * high[g]), float(p[g]), float(least[g]),
            float(observed.scatter[0, g]), float(scatter_low[g]), float(scatter_high[g]),
            float(p_scatter[g]), float(least_scatter[g]),
        )
        for g, name in enumerate(held_out[0].names)
    )  # fmt: skip


def _membership(network: Network, channels: Sequence[str]) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Names of the groups of channels, and (R, G) 1 if a channel is in a group."""
    groups = event_groups(network)
    table = [[int(base_channel(channel) in members) for members in groups.values()] for channel in channels]
    return tuple(groups), np.array(table, dtype=np.int64).reshape(len(channels), len(groups))


def _until(path: JumpPath, end: float) -> JumpPath:
    """The path as if it had ended at `end`."""
    kept = path.times <= end
    return JumpPath(path.network, path.initial, path.times[kept], path.channels[kept], end)


def _exposures(path: JumpPath, model: Network) -> Floats:
    """Integrals (R,) of ways * combinations over a path, tu, for the channels of the simulated network."""
    waits = np.diff(np.concatenate([[0.0], path.times, [path.end]]))
    return model.ways * (waits @ model.combinations_of(path.states))
