"""Is a rate the same in several groups of runs, or of stretches of runs?"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from calibration import plots
from calibration.estimating.diagnosing.base import ChannelDiagnostic, DiagnosticResult, Judged
from calibration.estimating.diagnosing.conditional import Trended, spread_test, trend_test
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.joins_and_breaks import joins_and_breaks
from kinetics.support.arrays import Floats, Ints
from kinetics.support.intervals import exact_limits
from kinetics.support.shown import on_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Groups(NamedTuple):
    """Events (G, R) and integrated hazard (G, R) of all channels in G groups with names."""

    labels: Sequence[str]
    events: Ints
    exposure: Floats


@dataclass(frozen=True, eq=False)
class GroupRates:
    """The rate of one channel in several groups, in units of its rate in all of them.

    labels : G names; events, exposure : (G,), every exposure above 0
    """

    channel: str
    labels: tuple[str, ...]
    events: Ints
    exposure: Floats

    @property
    def rates(self) -> Floats:
        """(G,) in units of the pooled rate."""
        return self.events / self._expected

    @property
    def _expected(self) -> Floats:
        return self.exposure * float(self.events.sum()) / float(self.exposure.sum())

    def intervals(self, level: float = 0.95) -> tuple[Floats, Floats]:
        """Exact limits (G,) of the rates, the pooled rate being taken as known."""
        return exact_limits(self.events, self._expected, level)

    @on_axes
    def plot(self, ax: Axes, p_value: float) -> Axes:
        """Plot the rates of the groups with their intervals; returns `ax`."""
        return plots.homogeneity(ax, self.channel, self.labels, plots.Limited(self.rates, *self.intervals()), p_value)


class SpreadDiagnostic(ChannelDiagnostic):
    """A diagnostic of the spread of a channel's rate over groups. Statistic: Pearson's chi-square, or the plain sum of
    squares, in units of its mean under one rate; the p-value is of the multinomial spread of the events."""

    by_expected: ClassVar[bool] = True  # Pearson's; plain squares where groups are so small that one event ends them
    single: ClassVar[str]  # why there is nothing to compare, where all exposure is in one group
    remedy: ClassVar[str]

    @abstractmethod
    def groups(self, diagnosed: DiagnosedRuns) -> Groups:
        """The groups."""

    def judge(self, diagnosed: DiagnosedRuns, channel: int) -> Judged | str:
        """The test of one channel."""
        labels, events, exposure = self.groups(diagnosed)
        is_exposed = exposure[:, channel] > 0
        if is_exposed.sum() < 2:
            return self.single
        chosen = tuple(label for label, there in zip(labels, is_exposed, strict=True) if there)
        found = GroupRates(
            diagnosed.network.channels[channel], chosen, events[is_exposed, channel], exposure[is_exposed, channel]
        )
        if not found.events.any():
            return "its events fell into stretches without duration"
        rng = diagnosed.random(self.name, channel)
        dispersion, p_value = spread_test(found.events, found.exposure, rng, by_expected=self.by_expected)
        high, low = int(np.argmax(found.rates)), int(np.argmin(found.rates))
        if len(chosen) <= 4:
            seen = (
                f"{found.rates[high]:.2f} of the pooled rate in {chosen[high]}, {found.rates[low]:.2f} in {chosen[low]}"
            )
        else:
            seen = f"counts vary {dispersion:.2f} times as much as those of one rate"
        return Judged(dispersion, p_value, seen, self.remedy, partial(found.plot, p_value=p_value))


class TrendDiagnostic(ChannelDiagnostic):
    """A diagnostic of the trend of a channel's rate with a quantity that is known in every stretch of a run.

    Statistic: the score test of a rate proportional to exp(beta * quantity), in standard deviations (Cox & Lewis 1966);
    the p-value is two-sided, of the multinomial spread of the events, and at least valid.
    """

    single: ClassVar[str]

    @abstractmethod
    def values(self, diagnosed: DiagnosedRuns) -> list[Floats]:
        """The quantity (E + 1,) in every stretch of each run."""

    @abstractmethod
    def unit(self, diagnosed: DiagnosedRuns) -> str:
        """The unit that the quantity counts."""

    @abstractmethod
    def remedy(self, diagnosed: DiagnosedRuns, channel: int) -> str:
        """The model to try next."""

    def results(self, diagnosed: DiagnosedRuns) -> list[DiagnosticResult]:
        """One result a channel, then one of all joins and one of all breaks, whose trends add up."""
        single = super().results(diagnosed)
        pooled = []
        members = joins_and_breaks(diagnosed.network)
        for whole, is_member in members.items():
            name, mine = f"all {whole}", np.flatnonzero(is_member).tolist()
            chosen = [j for j in mine if single[j].p_value is not None]
            n = sum(single[j].events for j in mine)
            if len(chosen) > 1:
                pooled.append(DiagnosticResult(self.name, name, n, **self._judge(diagnosed, name, chosen)._asdict()))
            else:
                pooled.append(DiagnosticResult(self.name, name, n, reason="fewer than two channels can be tested"))
        return [*single, *pooled]

    def judge(self, diagnosed: DiagnosedRuns, channel: int) -> Judged | str:
        """The test of one channel."""
        values, events, exposure = self._grouped(diagnosed)
        is_exposed = exposure[:, channel] > 0
        if is_exposed.sum() < 2:
            return self.single.format(value=f"{values[0]:g} {self.unit(diagnosed)}")
        # Two events in one step leave a state without duration between them: such an event is in no group.
        if not events[is_exposed, channel].any():
            return "its events fell into stretches without duration"
        return self._judge(diagnosed, diagnosed.network.channels[channel], [channel])

    def _judge(self, diagnosed: DiagnosedRuns, name: str, channels: Sequence[int]) -> Judged:
        values, events, exposure = self._grouped(diagnosed)
        tables = []
        for j in channels:
            there = exposure[:, j] > 0
            tables.append(Trended(events[there, j], exposure[there, j], values[there]))
        score, p_value = trend_test(tables, diagnosed.random(self.name, name))
        expected = sum(exposure[:, j] * events[:, j].sum() / exposure[:, j].sum() for j in channels)
        is_exposed = np.asarray(expected) > 0
        labels, classes = _classes(values[is_exposed], expected[is_exposed])
        found = GroupRates(
            name,
            tuple(f"{label} {self.unit(diagnosed)}" for label in labels),
            np.bincount(classes, events[:, list(channels)].sum(axis=1)[is_exposed]).astype(np.int64),
            np.bincount(classes, expected[is_exposed]).astype(float),
        )
        seen = (
            f"{found.rates[-1]:.2f} of the pooled rate at {found.labels[-1]}, {found.rates[0]:.2f} at {found.labels[0]}"
        )
        remedy = self.remedy(diagnosed, channels[0])
        return Judged(score, p_value, seen, remedy, partial(found.plot, p_value=p_value))

    def _grouped(self, diagnosed: DiagnosedRuns) -> tuple[Floats, Ints, Floats]:
        """Distinct values (G,) of the quantity, and events and exposure (G, R) at each."""
        at = self.values(diagnosed)
        values = np.unique(np.concatenate(at))
        return values, *diagnosed.grouped([np.searchsorted(values, each) for each in at], values.size)


def _classes(values: Floats, exposure: Floats, n: int = 4) -> tuple[list[str], Ints]:
    """Rising values (G,) in at most n classes of about equal exposure: the classes' names, and each value's class."""
    if values.size <= n:
        return [f"{value:g}" for value in values], np.arange(values.size)
    middle = (np.cumsum(exposure) - exposure / 2) / exposure.sum()
    used, classes = np.unique(np.minimum((middle * n).astype(np.int64), n - 1), return_inverse=True)
    names = []
    for k in range(used.size):
        inside = values[classes == k]
        names.append(f"{inside[0]:g}" if inside.size == 1 else f"{inside[0]:g}-{inside[-1]:g}")
    return names, classes
