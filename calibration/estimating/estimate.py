"""Mass-action rate constants in closed form: pooled events over pooled exposure, with exact intervals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import factorial, prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from calibration.estimating.exposure import Crowd, Exposure, count, crowding_of, pooled, require_same
from calibration.estimating.joins_and_breaks import joins_and_breaks
from kinetics.network import Crowding, Network
from kinetics.rates.breaks import Expansion, break_model
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats
from kinetics.support.intervals import exact_limits, jeffreys_posterior
from kinetics.support.shown import ResultTable, Shown, on_axes
from kinetics.support.tables import inverse, of_unit, rate_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from kinetics.rates import Rates


@dataclass(frozen=True)
class RateEstimate:
    """The maximum-likelihood rate constant of one channel.

    events : firings n
    exposure : integral of ways * h(s(t)) dt, tu; censored waits count in full
    ways : docking ways N of the channel; `rate` is per way, `rate * ways` per combination of reactants

    A channel without exposure is not measured: rate nan, interval (0, inf).

    >>> from calibration import RateEstimate
    >>> bind = RateEstimate("bind", events=4, exposure=200.0)
    >>> bind.rate, [round(limit, 4) for limit in bind.interval()]
    (0.02, [0.0054, 0.0512])
    """

    channel: str
    events: int
    exposure: float
    ways: float = 1.0

    @property
    def is_measured(self) -> bool:
        """True if the channel could have fired at some time."""
        return self.exposure > 0

    @property
    def rate(self) -> float:
        """Rate constant k = events / exposure, 1/tu."""
        return self.events / self.exposure if self.is_measured else float("nan")

    def interval(self, level: float = 0.95, fixed: str = "exposure") -> tuple[float, float]:
        """Limits of k, 1/tu, by `exact_limits`, which explains `fixed`."""
        low, high = exact_limits(self.events, self.exposure, level, fixed)
        return float(low), float(high)

    @property
    def posterior(self) -> tuple[float, float]:
        """Shape and rate of the Gamma posterior under Jeffreys' prior."""
        return jeffreys_posterior(self.events, self.exposure)

    @on_axes
    def plot(self, ax: Axes, level: float = 0.95) -> Axes:
        """One row of a forest plot, the rate with its interval; returns `ax`."""
        from calibration import plots

        low, high = self.interval(level)
        plots.forest_row(ax, self.channel, self.rate, low, high)
        ax.set_xlabel("rate constant k (1/tu)")
        return ax


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Shown):
    """The rates of a network as estimated from runs.

    runs : events and exposure of each run; their sum gives the estimates, their spread the diagnostics

    >>> from calibration import Calibration, Exposure
    >>> from kinetics import Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> calibration = Calibration(decay, (Exposure(decay, [2], [2.0]), Exposure(decay, [1], [4.0])))
    >>> calibration["decay"].rate
    0.5
    """

    network: Network
    runs: tuple[Exposure, ...]

    def __post_init__(self) -> None:
        for run in self.runs:
            require_same(self.network, run.network)

    @property
    def headline(self) -> str:
        """One line: the numbers of channels and runs."""
        return f"rates of {len(self.network.channels)} channels from {len(self.runs)} runs"

    def summary(self) -> ResultTable:
        """One row a channel: events, exposure, and the rate with its interval."""
        rows = [
            (
                row["channel"],
                str(row["events"]),
                f"{row['exposure']:.4g}",
                row["note"] or f"{rate_figure(row['rate'], row['high'], '.4g')} [{row['low']:.3g}, {row['high']:.3g}]",
            )
            for row in self.table()
        ]
        unit = self.network.time_unit or "tu"
        titles = ("channel", "events", of_unit("exposure", unit), of_unit("rate constant, 95 % interval", f"1/{unit}"))
        return ResultTable(self.headline, titles, rows)

    def to_arviz(self, draws: int = 1000, chains: int = 4, seed: int = 0) -> Any:
        """Independent draws of the rate constants from their posteriors, with the evidence, as `arviz.InferenceData`.

        Under Jeffreys' prior each is Gamma(events + 1/2, exposure); a channel that no run could fire has the prior of
        `rates`. Needs the extra `inference`.
        """
        return self.rates().posterior(self.network).to_arviz(draws, chains, seed)

    @cached_property
    def total(self) -> Exposure:
        """All runs pooled."""
        return pooled(self.runs)

    @cached_property
    def estimates(self) -> tuple[RateEstimate, ...]:
        """One estimate per channel, in the network's order."""
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

    @property
    def not_seen(self) -> list[str]:
        """Channels that could fire, and never did."""
        return [e.channel for e in self.estimates if e.is_measured and not e.events]

    def rates(self, evidence: Mapping[str, Any] | None = None) -> Rates:
        """The estimates as a rates table with 95 % intervals; `evidence` says where they come from.

        A join or break that no run could fire gets a prior from the others, and is marked, see `ChannelRate.prior`.
        ValueError: no channel of its kind was measured either.
        """
        from kinetics.rates import ChannelRate, Convention, Rates

        channels = {
            row["channel"]: {key: row[key] for key in ChannelRate.__struct_fields__ if key in row}
            for row in self.table()
        }
        for name in self.not_measured:
            channels[name] |= prior_of(name, self.network, self.total.events, self.total.exposure)
        tank = self.total.tank
        return Rates(
            convention=Convention.of(self.network),
            tank=None if tank is None else tank.size,
            channels={name: ChannelRate(**row) for name, row in channels.items()},
            network=self.network.fingerprint,
            evidence=dict(evidence or {}),
        )

    def table(self, level: float = 0.95) -> list[dict[str, Any]]:
        """One row per channel: events, exposure (tu), ways, rate and limits (1/tu)."""
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

    @on_axes
    def plot(self, ax: Axes, level: float = 0.95, references: Mapping[str, Rates] | None = None) -> Axes:
        """Forest plot of k N per distinct combination of reactants, beside other rates (label -> Rates); returns `ax`.

        For unlike reactants the conventions agree; the factor 2 of like pairs is taken out (for the literal product
        s * s up to one part in s), so that tables of any convention can be compared.
        """
        from calibration import plots

        names = self.network.channels
        scale = per_combination(self.network)
        low, high = exact_limits(self.total.events, self.total.exposure, level)
        rates = np.array([estimate.rate for estimate in self.estimates])
        sets = {f"measured, {100 * level:g} % interval": plots.Limited(rates * scale, low * scale, high * scale)}
        for label, reference in (references or {}).items():
            known = reference.apply(self.network)
            scale = per_combination(known)
            limits = [[reference.channels[name].low, reference.channels[name].high] for name in names]
            below, above = np.array(limits, dtype=float).T  # nan for None
            sets[label] = plots.Limited(known.known_rates * scale, below * scale, above * scale)
        return plots.forest(
            ax, names, sets, of_unit("rate per combination of reactants, k N", inverse(self.network.time_unit))
        )


def estimate(measured: Iterable[JumpPath | Exposure], crowd: Crowd | None = None) -> Calibration:
    """Estimate rates from runs of one network, as pooled events over pooled exposure.

    measured : paths or exposures, one per run, from any initial states, restarted or not, with any channels closed
    crowd : factors of joins in the tank of a run; None for mass action
    ValueError: no runs, runs of several networks, or some with a tank and some without

    It is the largest likelihood under mass action (Albert 1962, doi:10.1214/aoms/1177704594). Cost: linear in events
    times channels.

    >>> from calibration import estimate
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> path = JumpPath(decay, {"A": 2}, times=[0.5, 1.5], channels=[0, 0], end=3.0)
    >>> estimate([path])["decay"].rate  # 2 events over 2 * 0.5 + 1 * 1.0
    1.0
    """
    runs = tuple(run if isinstance(run, Exposure) else count(run, crowding=_crowding(run, crowd)) for run in measured)
    if not runs:
        raise ValueError("no runs to estimate from; give at least one path or exposure")
    return Calibration(runs[0].network, runs)


def _crowding(run: JumpPath, crowd: Crowd | None) -> Crowding | None:
    return crowding_of(crowd, Expansion.of(run.network, break_model("first-order")), run.tank)


def prior_of(channel: str, network: Network, events: ArrayLike, exposures: ArrayLike) -> dict[str, Any]:
    """The prior for a join or break that no run could fire, by the fields of `ChannelRate`.

    events, exposures : (R,) of all channels; of joins, or of breaks, they are pooled
    ValueError: a channel that is neither, or a group of which no channel was measured.
    """
    seen, observed = np.asarray(events, dtype=float), np.asarray(exposures, dtype=float)
    for group, members in joins_and_breaks(network).items():
        total = float(observed[members].sum())
        if members[network.channel_places[channel]] and total > 0:
            shape, rate = jeffreys_posterior(float(seen[members].sum()), total)
            exposure = 0.5 * rate / shape  # half an event at the mean of the group
            high = float(exact_limits(0, exposure)[1])
            return {"rate": 0.0, "low": 0.0, "high": high, "events": 0, "exposure": exposure, "prior": group}
    raise ValueError(
        f"no run could fire {channel}, or another channel of its kind: not measured; add runs whose initial state "
        "holds the reactants"
    )


def per_combination(network: Network) -> Floats:
    """Factors (R,) from a rate constant k to the rate of one distinct combination of reactants."""
    if network.combinations == "distinct":
        return network.ways
    needed = network.sparse_reactants
    like = [prod(factorial(n) for n in needed.row(channel)[1].tolist()) for channel in range(len(network.channels))]
    return network.ways * np.array(like, dtype=np.float64)
