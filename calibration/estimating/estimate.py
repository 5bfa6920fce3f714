"""Rates from counted paths: pooled events over pooled exposure, with exact intervals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from calibration.estimating.exposure import Exposure, count, pooled, require_same
from kinetics.network import Network
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from kinetics.rates import Rates


def exact_limits(
    events: ArrayLike, exposure: ArrayLike, level: float = 0.95, fixed: str = "exposure"
) -> tuple[Floats, Floats]:
    """Lower and upper limits of the rates behind counts `events`, in units of 1 / exposure.

    fixed : what was chosen beforehand. `exposure`: runs of a given length (Garwood 1936; finite also for no event).
        `events`: watching went on until that many events had happened (chi-square with 2 n degrees of freedom).

    Exact where the exposure itself is fixed; approximate where it follows from the path, with a coverage near the level
    once there are some ten events. (0, inf) where there is no exposure.
    """
    from scipy.special import gammainccinv, gammaincinv

    if not 0 < level < 1:
        raise ValueError(f"level = {level}; expected a number between 0 and 1, such as 0.95")
    if fixed not in {"exposure", "events"}:
        raise ValueError(f"fixed = {fixed!r}; expected 'exposure' or 'events'")
    n, total = np.broadcast_arrays(np.asarray(events, dtype=float), np.asarray(exposure, dtype=float))
    if fixed == "events" and (n == 0).any():
        raise ValueError("fixed = 'events' needs at least one event in every channel; use 'exposure'")
    tail = (1 - level) / 2
    low = np.where(n > 0, gammaincinv(np.maximum(n, 1), tail), 0.0)
    high = gammainccinv(n + 1 if fixed == "exposure" else n, tail)
    is_measured = total > 0
    return (
        np.divide(low, total, out=np.zeros(n.shape), where=is_measured),
        np.divide(high, total, out=np.full(n.shape, np.inf), where=is_measured),
    )


@dataclass(frozen=True)
class RateEstimate:
    """Maximum-likelihood rate constant of one channel.

    events : firings n
    exposure : integral of ways * h(s(t)) dt, tu; censored waits count in full
    ways : docking ways N of the channel; `rate` is per way, `rate * ways` per combination of reactants

    A channel without exposure is not measured: rate nan, interval (0, inf).
    """

    channel: str
    events: int
    exposure: float
    ways: float = 1.0

    @property
    def is_measured(self) -> bool:
        """Whether the channel could ever have fired."""
        return self.exposure > 0

    @property
    def rate(self) -> float:
        """Rate constant k = events / exposure, 1/tu."""
        return self.events / self.exposure if self.is_measured else float("nan")

    def interval(self, level: float = 0.95, fixed: str = "exposure") -> tuple[float, float]:
        """Exact limits of k, 1/tu; `fixed` as in `exact_limits`."""
        low, high = exact_limits(self.events, self.exposure, level, fixed)
        return float(low), float(high)

    @property
    def posterior(self) -> tuple[float, float]:
        """Shape and rate of the Gamma posterior under Jeffreys' prior: events + 1/2, exposure."""
        return self.events + 0.5, self.exposure

    def credible_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Equal-tailed posterior limits of k, 1/tu."""
        from scipy.special import gammaincinv

        if not self.is_measured:
            return 0.0, float("inf")
        shape, rate = self.posterior
        tail = (1 - level) / 2
        return float(gammaincinv(shape, tail) / rate), float(gammaincinv(shape, 1 - tail) / rate)

    def plot(self, ax: Axes, level: float = 0.95) -> Axes:
        """One row of a forest plot, the rate with its interval; returns `ax`."""
        from calibration import plots

        low, high = self.interval(level)
        plots.forest_row(ax, self.channel, self.rate, low, high)
        ax.set_xlabel("rate constant k (1/tu)")
        return ax


@dataclass(frozen=True, eq=False)
class Calibration:
    """The rates of a network as runs showed them.

    runs : the exposure of each run; their sum gives the estimates, their spread the diagnostics
    """

    network: Network
    runs: tuple[Exposure, ...]

    def __post_init__(self) -> None:
        for run in self.runs:
            require_same(self.network, run.network)

    @cached_property
    def total(self) -> Exposure:
        """All runs pooled."""
        return pooled(self.runs)

    @cached_property
    def estimates(self) -> tuple[RateEstimate, ...]:
        """One estimate a channel, in the network's order."""
        total = self.total
        return tuple(
            RateEstimate(name, int(n), float(exposure), float(ways))
            for name, n, exposure, ways in zip(
                self.network.channels, total.events, total.exposure, self.network.ways, strict=True
            )
        )

    def __getitem__(self, channel: str) -> RateEstimate:
        if channel not in self.network.channels:
            raise ValueError(f"unknown channel {channel!r}; channels are {', '.join(self.network.channels)}")
        return self.estimates[self.network.channels.index(channel)]

    @property
    def not_measured(self) -> tuple[str, ...]:
        """Channels that no run could have fired."""
        return tuple(e.channel for e in self.estimates if not e.is_measured)

    def rates(self, evidence: Mapping[str, Any] | None = None) -> Rates:
        """The estimates as a rates file with 95 % intervals; `evidence` tells where they come from.

        Refused while a channel is not measured: a prediction needs every rate.
        """
        from kinetics.rates import ChannelRate, Rates

        if self.not_measured:
            raise ValueError(
                f"no run could fire {', '.join(self.not_measured)}: not measured; "
                "add runs whose initial state holds the reactants"
            )
        channels = {row["channel"]: {key: row[key] for key in ChannelRate.model_fields} for row in self.table()}
        return Rates.model_validate(
            {
                "convention": {"combinations": self.network.combinations},
                "channels": channels,
                "network": self.network.fingerprint,
                "evidence": dict(evidence or {}),
            }
        )

    def table(self, level: float = 0.95) -> list[dict[str, Any]]:
        """One row a channel: events, exposure (tu), ways, rate and limits (1/tu)."""
        rows = []
        for estimate in self.estimates:
            low, high = estimate.interval(level)
            rows.append(
                {
                    "channel": estimate.channel,
                    "events": estimate.events,
                    "exposure": estimate.exposure,
                    "ways": estimate.ways,
                    "rate": estimate.rate,
                    "low": low,
                    "high": high,
                    "note": "" if estimate.is_measured else "not measured",
                }
            )
        return rows

    def plot(self, ax: Axes, level: float = 0.95, references: Mapping[str, Rates] | None = None) -> Axes:
        """Forest plot of the rates per pair of reactants, beside those of others (label -> Rates); returns `ax`."""
        from calibration import plots

        return plots.rates(ax, self, level=level, references=references)


def estimate(measured: Iterable[JumpPath | Exposure]) -> Calibration:
    """Rates from runs of one network: pooled events over pooled exposure.

    measured : paths or exposures, one a run, from any initial states, restarted or not, with any channels closed
    """
    runs = tuple(run if isinstance(run, Exposure) else count(run) for run in measured)
    if not runs:
        raise ValueError("no runs to estimate from; give at least one path or exposure")
    return Calibration(runs[0].network, runs)


def paper_estimate(paths: Sequence[JumpPath]) -> dict[str, float]:
    """The paper's own estimator (eqs 12-15), in our convention (per docking way): for comparison only.

    Per initial state the clock runs while the system is in that state, on through restarts and runs of the same kind.
    The waits between the firings of a channel have a mean; 1 / (mean wait * ways * h) is the rate there, and the rates
    are averaged over the initial states. The last, censored wait is dropped, so the mean of n waits comes out too
    short: the rate is too high by n / (n - 1) on average, and averaging over initial states does not cure that.
    nan for a channel that never fired first.
    """
    if not paths:
        raise ValueError("no runs to estimate from; give at least one path")
    groups: dict[bytes, list[JumpPath]] = {}
    for path in paths:
        groups.setdefault(path.initial.tobytes() + path.open_channels.tobytes(), []).append(path)
    rates = [_rates_in_one_state(group) for group in groups.values()]
    network = paths[0].network
    collected = {name: [row[j] for row in rates if np.isfinite(row[j])] for j, name in enumerate(network.channels)}
    return {name: float(np.mean(seen)) if seen else float("nan") for name, seen in collected.items()}


def _rates_in_one_state(paths: Sequence[JumpPath]) -> Floats:
    """Eqs 14 and 15 for runs from one initial state: (R,) rates, nan where a channel never fired first."""
    network = paths[0].network
    clock = 0.0
    fired: list[tuple[float, int]] = []
    for path in paths:
        edges = np.concatenate(([0.0], path.times, [path.end]))
        before = np.concatenate(([RESTART], path.channels))
        after = np.concatenate((path.channels, [RESTART]))
        for i in np.flatnonzero(before == RESTART):
            clock += edges[i + 1] - edges[i]
            if after[i] != RESTART:
                fired.append((clock, int(after[i])))
    combinations = network.combinations_of(paths[0].initial)
    rates = np.full(len(network.channels), np.nan)
    for j in {channel for _, channel in fired}:
        moments = [moment for moment, channel in fired if channel == j]
        mean_wait = moments[-1] / len(moments)  # the waits between firings add up to the last moment
        rates[j] = 1 / (mean_wait * network.ways[j] * combinations[j])
    return rates
