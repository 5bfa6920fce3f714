"""Held-out growth beside its prediction by network-free runs: curves of what the tank holds, joins and breaks.

As in `crossvalidation`, the measure is the posterior predictive distribution of the experiment itself: groups of as
many runs as were held out, each group under its own draw of the class rates. The prediction needs no network.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.validating.growth_power import KINDS, growth_powers
from calibration.validating.power import LEVEL, Power
from calibration.validating.predictive import clear_p, least_p, looks, predictive_p, shown_p
from calibration.validating.scores import central_band, mean_misfit
from calibration.validating.verdict import ConsistencyCheck, Verdict, judged
from kinetics.networkfree import Growth, Growths, grow
from kinetics.networkfree.growth import NOTHING
from kinetics.rates import ClassRates
from kinetics.support import plots
from kinetics.support.arrays import Floats, Ints, rising_times
from kinetics.support.datasets import dataframe_over_times
from kinetics.support.packages import pd, plt
from kinetics.support.shown import ResultTable, Shown, Tabular
from kinetics.support.tables import text_table

GROUPS = 199
MOST_GROUPS = 1999  # where a p-value stays small: with eight checks .00125 is asked for
MORE = 1_000_003  # added to the seed each time that more groups are asked for
POWER, POWER_GROUPS = 2_000_003, 50  # the same for groups at rates that are off; so many for each sign


@dataclass(frozen=True)
class GrowthEvents:
    """Joins or breaks of all held-out runs: seen, expected, and the middle 95 % of predicted groups, with a p-value."""

    kind: str
    seen: int
    expected: float
    low: float
    high: float
    p: float


@dataclass(frozen=True, eq=False, repr=False)
class GrowthComparison(Shown, Tabular):
    """Held-out runs from one initial state beside their prediction. Arrays (T, V) over times (tu) and V curves.

    curves : structures by class of sizes, copies of the target, cubes of the largest structure
    observed, predicted : means of a run
    low, high : predicted band of the mean of as many runs, from their noise and the uncertainty of the rates
    misfit, p_misfit : (V,) mean squared z of a curve among predicted groups, about 1; share of groups with as much
    coverage : (V,) share of times after 0 at which the observed mean lies inside the band
    groups : as many as the smallest p-value took to be clear; most_groups, how many there would have been at most
    powers : how surely so many runs show joins and breaks that are off, by their number
    """

    label: str
    times: Floats
    runs: int
    groups: int
    curves: tuple[str, ...]
    observed: Floats
    predicted: Floats
    low: Floats
    high: Floats
    misfit: Floats
    p_misfit: Floats
    coverage: Floats
    events: tuple[GrowthEvents, ...]
    most_groups: int = 0
    powers: tuple[Power, ...] = ()

    @property
    def headline(self) -> str:
        """One line: the label of the comparison, and the numbers of runs and predicted groups."""
        return f"{self.label}, {self.runs} runs, compared with {self.groups} predicted groups of as many"

    def summary(self) -> ResultTable:
        """The curves at the last time; the verdict below."""
        rows = [curve[:4] for curve in self._curve_rows()]
        titles = (f"mean at {self.times[-1]:g} tu", "seen", "predicted (95 %)", "times inside")
        return ResultTable(self.headline, titles, rows, [self.sentence])

    @cached_property
    def verdict(self) -> Verdict:
        """Joins, breaks and every curve together; see `cannot_fail` for the checks that so few groups never fail."""
        least = 1 / (self.groups + 1)
        checks = [
            ConsistencyCheck(
                f"{e.kind} {self.label} {e.seen} seen, {e.expected:.3g} ({e.low:.3g}-{e.high:.3g}) expected",
                e.p,
                least_p(self.groups),
            )
            for e in self.events
        ]
        checks += [
            ConsistencyCheck(
                f"curve of {name} {self.label} with a misfit of {misfit:.2g} (1 expected)", float(p), least
            )
            for name, misfit, p in zip(self.curves, self.misfit, self.p_misfit, strict=True)
        ]
        return judged(checks, self.powers)

    @property
    def is_consistent(self) -> bool:
        """True if no check fails at 1 %, corrected for their number."""
        return self.verdict.is_consistent

    @property
    def cannot_fail(self) -> tuple[str, ...]:
        """The checks that no held-out runs could fail, because the p-values of so few groups are not small enough."""
        asked = LEVEL / (len(self.events) + len(self.curves))
        groups = max(self.groups, self.most_groups)
        events = [e.kind for e in self.events] if least_p(groups) > asked else []
        return (*events, *(self.curves if 1 / (groups + 1) > asked else ()))

    @property
    def sentence(self) -> str:
        """The verdict; if some checks cannot fail, which, and how many groups it takes."""
        if not self.cannot_fail:
            return self.verdict.sentence
        needed = math.ceil(2 * (len(self.events) + len(self.curves)) / LEVEL) - 1
        words = (
            f"{max(self.groups, self.most_groups)} groups cannot fail {', '.join(self.cannot_fail)}; "
            f"give at least {needed}"
        )
        return f"{'not decided' if self.is_consistent else self.verdict.sentence}: {words}"

    @property
    def is_clear(self) -> bool:
        """True if no p-value needs more groups to be clear."""
        return bool(min([*self.p_misfit, *(e.p for e in self.events)]) >= clear_p(self.groups))

    def with_clear_ones_of(self, fewer: GrowthComparison) -> GrowthComparison:
        """A copy with the p-values that were clear with fewer groups: valid at every level, see `sequential_p`."""
        clear = clear_p(fewer.groups)
        known = {e.kind: e for e in fewer.events if e.p >= clear}
        places = {name: v for v, name in enumerate(fewer.curves) if fewer.p_misfit[v] >= clear}
        p = [
            fewer.p_misfit[places[name]] if name in places else own
            for name, own in zip(self.curves, self.p_misfit, strict=True)
        ]
        events = tuple(replace(e, p=known[e.kind].p) if e.kind in known else e for e in self.events)
        return replace(self, p_misfit=np.array(p), events=events)

    def table(self) -> str:
        """Events and curves, for people."""
        events = [
            (e.kind, str(e.seen), f"{e.expected:.1f} ({e.low:.0f}-{e.high:.0f})", shown_p(e.p, least_p(self.groups)))
            for e in self.events
        ]
        curves = (f"mean at {self.times[-1]:g} tu", "seen", "predicted (95 %)", "times inside", "misfit", "")
        return "\n".join(
            [
                self.headline,
                text_table(("events", "seen", "expected (95 %)", ""), events),
                text_table(curves, self._curve_rows()),
            ]
        )

    def _curve_rows(self) -> list[tuple[str, ...]]:
        """One row a curve: means at the last time, times inside the band, misfit and its p."""
        return [
            (
                name,
                f"{self.observed[-1, v]:.3g}",
                f"{self.predicted[-1, v]:.3g} ({self.low[-1, v]:.3g}-{self.high[-1, v]:.3g})",
                f"{self.coverage[v]:.0%}",
                f"{self.misfit[v]:.2g}",
                shown_p(float(self.p_misfit[v]), 1 / (self.groups + 1)),
            )
            for v, name in enumerate(self.curves)
        ]

    def to_dataframe(self) -> pd.DataFrame:
        """One row a time and curve."""
        columns = {"observed": self.observed, "predicted": self.predicted, "low": self.low, "high": self.high}
        frame = dataframe_over_times(self.times, "curve", self.curves, columns)
        frame.insert(0, "label", self.label)
        return frame

    def to_dict(self) -> dict[str, Any]:
        """The comparison as a dictionary, ready for JSON."""
        return {
            "label": self.label,
            "runs": self.runs,
            "groups": self.groups,
            "is_consistent": self.is_consistent,
            "verdict": self.sentence,
            "cannot_fail": list(self.cannot_fail),
            "powers": [vars(power) for power in self.powers],
            "events": [vars(e) for e in self.events],
            "times": self.times.tolist(),
            "curves": {
                name: {
                    "observed": self.observed[:, v].tolist(),
                    "predicted": self.predicted[:, v].tolist(),
                    "low": self.low[:, v].tolist(),
                    "high": self.high[:, v].tolist(),
                    "misfit": float(self.misfit[v]),
                    "p_misfit": float(self.p_misfit[v]),
                    "coverage": float(self.coverage[v]),
                }
                for v, name in enumerate(self.curves)
            },
        }

    def plot(self, figure: Any = None) -> Any:
        """One panel a curve, each with an axis of its own: predicted mean with its band, observed means as points.

        figure : a Matplotlib figure, which it fills; a new one where none is given. Returned
        """
        if figure is None:
            figure = plt.figure(layout="constrained")
        across = min(3, len(self.curves))
        panels = figure.subplots(-(-len(self.curves) // across), across, sharex=True, squeeze=False)
        for v, ax in enumerate(panels.flat):
            if v >= len(self.curves):
                ax.remove()
                continue
            ax.fill_between(self.times, self.low[:, v], self.high[:, v], color=plots.colour(0), alpha=0.2, linewidth=0)
            ax.plot(self.times, self.predicted[:, v], color=plots.colour(0))
            ax.plot(self.times, self.observed[:, v], ".", color="black", markersize=4)
            if not (self.high[:, v].any() or self.observed[:, v].any()):
                ax.set_ylim(-0.05, 1.0)  # else about 0, with signs and digits that mean nothing
            ax.set_title(self.curves[v], fontsize="medium")
            if v % across == 0:
                ax.set_ylabel("mean of a run")
            if v + across >= len(self.curves):
                ax.tick_params(labelbottom=True)
                ax.set_xlabel("time (tu)")
        words = f"{self.label}: points, mean of {self.runs} runs; line and band (95 %), predicted"
        figure.suptitle(words, fontsize="medium")
        return figure


def compare_growth(
    rates: ClassRates,
    observed: Sequence[Growth],
    times: ArrayLike,
    label: str = "",
    groups: int = GROUPS,
    most_groups: int = MOST_GROUPS,
    seed: int = 0,
    power_groups: int = POWER_GROUPS,
    progress: Callable[[int, float], None] | None = None,
) -> GrowthComparison:
    """Compare held-out growth (one book, one initial state) with network-free runs under draws of class rates.

    times : (T,) tu, rising, none after the end of a run
    groups, most_groups : number of draws of the rates, each with as many runs as there are held-out ones; about twice
        as many each time, and so many at most, while a p-value is small, see `sequential_p`
    power_groups : groups a sign and kind of event, at rates 20 % off, for the power that is stated; 0 for none
    progress : called with the number of predicted runs finished and the time reached in the current one, tu

    Events are those until the last of the times. Rates without evidence are taken as known.
    Cost: groups x runs network-free runs, up to ten times as many where the rates are wrong; for the power 4 x
    power_groups x runs.
    """
    if len(observed) < 2:
        raise ValueError(f"{len(observed)} held-out runs; a mean with a scatter needs at least 2")
    grid = rising_times(times)
    book = observed[0].book
    start = observed[0].at(0.0)
    for run in observed:
        if run.book.fingerprint != book.fingerprint or run.at(0.0) != start:
            raise ValueError("the held-out runs are of several books or initial states; compare one at a time")
    end, n = float(grid[-1]), len(observed)
    seen = Growths(tuple(observed))

    def made(by: ClassRates, number: int, own_seed: int) -> Growths:
        runs = grow(book, by, start, end, n * number, own_seed, progress, draws=number)
        if runs.interrupted:
            raise KeyboardInterrupt
        return runs

    def totals_off(by: ClassRates, part: int) -> Ints:
        return _totals([made(by, power_groups, seed + POWER + part)], n, end)

    simulated = [made(rates, groups, seed)]
    found = _beside(seen, simulated, grid, label)
    checks = len(found.events) + len(found.curves)
    totals = _totals(simulated, n, end)
    powers = growth_powers(rates, totals.astype(float), totals_off, checks) if power_groups else ()
    for number in looks(groups, most_groups)[1:]:
        if found.is_clear:
            break
        simulated.append(made(rates, number - found.groups, seed + MORE * len(simulated)))
        found = _beside(seen, simulated, grid, label).with_clear_ones_of(found)
    return replace(found, most_groups=most_groups, powers=powers)


def _beside(seen: Growths, made: Sequence[Growths], grid: Floats, label: str) -> GrowthComparison:
    """The comparison with the groups of several simulations."""
    most = max(part.most for part in (seen, *made))
    own = _curves(seen, grid, most)
    means = np.concatenate([_by_group(_curves(part, grid, most), len(seen.runs)).mean(axis=0) for part in made])
    low, high = central_band(means)
    mean = own.mean(axis=0)
    names = tuple(seen.series(grid[:1], most))
    fits = [mean_misfit(mean[:, v : v + 1], means[:, :, v : v + 1]) for v in range(len(names))]
    after = grid > 0
    inside = (low <= mean) & (mean <= high)
    return GrowthComparison(
        label,
        grid,
        len(seen.runs),
        len(means),
        names,
        mean,
        means.mean(axis=0),
        low,
        high,
        np.array([misfit for misfit, _ in fits]),
        np.array([p for _, p in fits]),
        inside[after].mean(axis=0),
        _events(seen, made, float(grid[-1])),
    )


def _by_group(values: NDArray[Any], runs: int) -> NDArray[Any]:
    """Values (runs, groups, ...) of simulated runs: run i of group g is number i * groups + g, as draws take turns."""
    return values.reshape(runs, -1, *values.shape[1:])


def _curves(growths: Growths, grid: Floats, most: int) -> Floats:
    """Curves (runs, T, V) of every run."""
    return np.stack(list(growths.series(grid, most).values()), axis=2).astype(float)


def _counted(growths: Growths, end: float) -> Ints:
    """Joins and breaks (runs, 2) until a time."""
    table = np.zeros((len(growths.runs), 2), dtype=np.int64)
    for row, run in zip(table, growths.runs, strict=True):
        joins = run.before[run.times <= end, 1] != NOTHING
        row[:] = joins.sum(), (~joins).sum()
    return table


def _totals(made: Sequence[Growths], runs: int, end: float) -> Ints:
    """Joins and breaks (groups, 2) of all runs of each group."""
    return np.concatenate([_by_group(_counted(part, end), runs).sum(axis=0) for part in made])


def _events(seen: Growths, made: Sequence[Growths], end: float) -> tuple[GrowthEvents, ...]:
    """Joins and breaks of all runs among those of the groups."""
    own = _counted(seen, end).sum(axis=0)
    others = _totals(made, len(seen.runs), end).astype(float)
    low, high = central_band(others)
    p = predictive_p(own.astype(float), others)
    return tuple(
        GrowthEvents(kind, int(own[k]), float(others[:, k].mean()), float(low[k]), float(high[k]), float(p[k]))
        for k, kind in enumerate(KINDS)
        if own[k] or others[:, k].any()
    )
