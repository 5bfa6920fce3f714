"""Diagnostics of calibration runs: tests of exponential waits, and of rates that are constant over runs and ages.

All tests condition on the number of events of a channel, so the unknown rate drops out and censored waits need no
correction: measured in its own exposure, a channel's events are a Poisson process, and n events of one are uniform on
the exposure watched. (Approximate only in that a channel's firings also change the exposure left to it.)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.estimating.estimate import estimate
from calibration.estimating.exposure import Exposure, by_age, by_initial, count
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats, Ints
from kinetics.support.intervals import exact_limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from calibration.estimating.rate_fit import RateFit

DRAWS = 4999  # of the multinomial null distribution; the smallest p-value is 1 / (DRAWS + 1)
# Ages at which runs are cut, tu: a cube at the paper's mean speed of 1.2 crosses its tank (2 wide) in about two.
AGES = (0.0, 2.0, 10.0, np.inf)


@dataclass(frozen=True, eq=False)
class WaitingTimes:
    """Waiting times as positions of events on the clock of their integrated hazard, with the runs set end to end.

    name : the channel, or `any event`
    positions : (n,) integrated hazard at each event, rising
    total : integrated hazard of all runs

    Setting runs end to end joins a censored wait to the first wait of the next run: for exponential waits that is one
    whole wait, so no data are lost.
    """

    name: str
    positions: Floats
    total: float

    @property
    def residuals(self) -> Floats:
        """Waits (n,) in units of their estimated mean, which are unit exponential if the hazard is right."""
        return np.diff(self.positions, prepend=0.0) * self.positions.size / self.total

    def drift_test(self) -> tuple[float, float]:
        """Kolmogorov-Smirnov distance of the positions from uniform, and its p-value (exact)."""
        from scipy.stats import kstest

        if not self.positions.size:
            return 0.0, 1.0
        result = kstest(self.positions / self.total, "uniform")
        return float(result.statistic), float(result.pvalue)

    def shape_test(self) -> tuple[float, float]:
        """Anderson-Darling statistic of the waits against an exponential of unknown mean, and its p-value.

        The n + 1 gaps between n uniform points are exponentials divided by their sum, so the classical test with an
        estimated mean applies if the last gap is included. The statistic is modified for sample size, and the p-value
        is the fit of D'Agostino & Stephens (1986, table 4.11), accurate to a few per cent of p.
        """
        gaps = np.sort(np.diff(self.positions, prepend=0.0, append=self.total))
        n = gaps.size
        if n < 3:
            return 0.0, 1.0
        # A gap of 0 (two events in one mechanics step) has no finite logarithm; it counts as the smallest one.
        x = np.maximum(gaps * n / self.total, 1e-12)
        odd = 2 * np.arange(1, n + 1) - 1
        statistic = -n - np.sum(odd * (np.log(-np.expm1(-x)) - x[::-1])) / n
        statistic *= 1 + 0.6 / n
        return float(statistic), _anderson_darling_p(float(statistic))

    def plot(self, ax: Axes) -> Axes:
        """Plot the survival of the residuals beside the unit exponential with its 95 % envelope; returns `ax`."""
        from calibration import plots

        return plots.waiting_times(ax, self.name, self.residuals)


def waiting_times(paths: Iterable[JumpPath], channel: str | None = None, fit: RateFit | None = None) -> WaitingTimes:
    """The waiting times of one channel, or of any event (then on the clock of the estimated total hazard).

    fit : model of rates whose hazard is the clock, fitted to this channel or to all channels; None: mass action
    """
    runs = list(paths)
    network = runs[0].network
    if channel is not None and channel not in network.channels:
        raise ValueError(f"unknown channel {channel!r}; channels are {', '.join(network.channels)}")
    wanted = network.channels if channel is None else (channel,)
    if fit is not None and not set(wanted) <= set(fit.channels):
        raise ValueError(f"the fit holds {', '.join(fit.channels)}; expected {', '.join(wanted)}")
    if fit is not None:
        columns = [fit.channels.index(name) for name in wanted]
    elif channel is None:
        weights = np.nan_to_num([e.rate for e in estimate(runs).estimates]) * network.ways
    else:
        weights = (np.array(network.channels) == channel) * network.ways
    positions, total = [], 0.0
    for path in runs:
        if fit is not None:
            passed = fit.integrated_hazards(path)[:, columns].sum(axis=1)
        else:
            edges = np.concatenate(([0.0], path.times, [path.end]))
            passed = np.diff(edges) * (network.combinations_of(path.states) @ (weights * path.open_channels))
        clock = total + np.cumsum(passed)
        is_event = path.channels != RESTART
        if channel is not None:
            is_event = path.channels == network.channels.index(channel)
        positions.append(clock[:-1][is_event])
        total = clock[-1]
    return WaitingTimes(channel or "any event", np.concatenate(positions), float(total))


@dataclass(frozen=True, eq=False)
class Homogeneity:
    """The rate of one channel in several groups of runs, and a test of whether it is the same in all.

    labels : G names
    events, exposure : (G,)
    dispersion : Pearson chi-square over its degrees of freedom; about 1 where the rate is one constant
    p_value : from draws of the same number of events over the groups in proportion to exposure
    """

    channel: str
    labels: tuple[str, ...]
    events: Ints
    exposure: Floats
    dispersion: float
    p_value: float

    @property
    def rates(self) -> Floats:
        """(G,) 1/tu, nan where a group has no exposure."""
        return np.divide(self.events, self.exposure, out=np.full(len(self.labels), np.nan), where=self.exposure > 0)

    def intervals(self, level: float = 0.95) -> tuple[Floats, Floats]:
        """Exact limits (G,) of the rates."""
        return exact_limits(self.events, self.exposure, level)

    def plot(self, ax: Axes) -> Axes:
        """Plot the rates of the groups with their intervals; returns `ax`."""
        from calibration import plots

        rates = plots.Limited(self.rates, *self.intervals())
        pooled_rate = self.events.sum() / self.exposure.sum()
        return plots.homogeneity(ax, self.channel, self.labels, rates, pooled_rate, self.p_value)


def homogeneity(groups: Mapping[str, Exposure], seed: int = 0) -> list[Homogeneity]:
    """Test, for every channel, whether its rate is the same in all groups (runs, ages or initial compositions)."""
    if not groups:
        raise ValueError("no groups to compare; give at least one")
    rng = np.random.default_rng(seed)
    labels = tuple(groups)
    events = np.array([group.events for group in groups.values()])
    exposure = np.array([group.exposure for group in groups.values()])
    found = []
    for j, channel in enumerate(next(iter(groups.values())).network.channels):
        dispersion, p_value = _dispersion_test(events[:, j], exposure[:, j], rng)
        found.append(Homogeneity(channel, labels, events[:, j], exposure[:, j], dispersion, p_value))
    return found


def _dispersion_test(events: Ints, exposure: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """Pearson's index and its p-value under a multinomial spread of the events; (nan, 1) with nothing to compare."""
    is_measured = exposure > 0
    groups, n = int(is_measured.sum()), int(events.sum())
    if groups < 2 or n == 0:
        return float("nan"), 1.0
    share = exposure[is_measured] / exposure.sum()
    expected = n * share
    drawn = rng.multinomial(n, share, size=DRAWS)
    null = ((drawn - expected) ** 2 / expected).sum(axis=1)
    observed = ((events[is_measured] - expected) ** 2 / expected).sum()
    # ties are many with few events, and rounding must not break them
    p_value = (1 + np.count_nonzero(null >= observed * (1 - 1e-9))) / (DRAWS + 1)
    return float(observed / (groups - 1)), float(p_value)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All diagnostics of a set of runs, channel by channel.

    waits : one entry per channel, then one for any event
    between_runs, by_age, by_initial : one entry per channel
    """

    waits: tuple[WaitingTimes, ...]
    between_runs: tuple[Homogeneity, ...]
    by_age: tuple[Homogeneity, ...]
    by_initial: tuple[Homogeneity, ...]

    @cached_property
    def _rows(self) -> list[dict[str, Any]]:
        rows = []
        for waits, runs, ages, initial in zip(
            self.waits[:-1], self.between_runs, self.by_age, self.by_initial, strict=True
        ):
            row = {"channel": runs.channel, "events": int(runs.events.sum()), "dispersion": runs.dispersion}
            for name, groups in (("between_runs", runs), ("age", ages), ("initial", initial)):
                row[f"p_{name}"] = np.nan if np.isnan(groups.dispersion) else groups.p_value
            n = waits.positions.size
            row["p_drift"] = waits.drift_test()[1] if n > 0 else np.nan
            row["p_shape"] = waits.shape_test()[1] if n > 1 else np.nan
            rows.append(row)
        return rows

    @property
    def not_testable(self) -> dict[str, list[str]]:
        """Test -> the channels that have too few events, or too few groups of runs, for it."""
        found: dict[str, list[str]] = {}
        for row in self._rows:
            for key in row:
                if key.startswith("p_") and np.isnan(row[key]):
                    found.setdefault(key[2:], []).append(row["channel"])
        return found

    @property
    def doubtful(self) -> list[str]:
        """Tests that fail at 1 % after Holm's correction for their number, as `channel: test`."""
        results = sorted(
            (row[key], f"{row['channel']}: {key[2:]}")
            for row in self._rows
            for key in row
            if key.startswith("p_") and not np.isnan(row[key])
        )
        failed = []
        for rank, (p_value, name) in enumerate(results):
            if p_value * (len(results) - rank) > 0.01:
                break
            failed.append(name)
        return failed

    def table(self) -> list[dict[str, Any]]:
        """One row per channel: events, dispersion between runs, p-value of each test; nan where it is not testable."""
        return [dict(row) for row in self._rows]


def diagnose(paths: Iterable[JumpPath], ages: Sequence[float] = AGES, seed: int = 0) -> Diagnosis:
    """All diagnostics of calibration runs.

    ages : edges of the classes of age, the time since the start or last restart of a run, tu; the first classes should
        span the time that the tank needs to mix
    """
    runs = list(paths)
    single = {f"run {i}": count(path) for i, path in enumerate(runs)}
    names = (*runs[0].network.channels, None)
    return Diagnosis(
        tuple(waiting_times(runs, name) for name in names),
        tuple(homogeneity(single, seed)),
        tuple(homogeneity(by_age(runs, ages), seed)),
        tuple(homogeneity(by_initial(runs), seed)),
    )


def _anderson_darling_p(a: float) -> float:
    """P-value of the modified statistic for an exponential whose mean was estimated."""
    if a < 0.26:
        return float(1 - np.exp(-12.2204 + 67.459 * a - 110.3 * a**2))
    if a < 0.51:
        return float(1 - np.exp(-6.1327 + 20.218 * a - 18.663 * a**2))
    if a < 0.95:
        return float(np.exp(0.9209 - 3.353 * a + 0.3 * a**2))
    return float(np.exp(0.731 - 3.009 * min(a, 10.0) + 0.15 * min(a, 10.0) ** 2))
