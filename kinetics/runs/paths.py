"""Records of runs: jump paths with every event, and ensembles of counts on a grid of times.

Simulated and mechanical runs give the same records, so that a reader need not know where one came from.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network, Tank
from kinetics.runs.truncation import Truncation
from kinetics.support import plots
from kinetics.support.arrays import Floats, Ints, integers, read_only, real_number, reals, rising_times
from kinetics.support.datasets import dataframe, dataset
from kinetics.support.frozen import set_fields
from kinetics.support.packages import pd
from kinetics.support.shown import (
    MOST_TIMES,
    ResultTable,
    Shown,
    Tabular,
    means_over_time,
    on_axes,
    over_time,
    precision_of,
)
from kinetics.support.tables import in_unit

if TYPE_CHECKING:
    import xarray as xr

MAX_STATES = 2**27  # counts in the table of all states of a path, 1 GB
RESTART = -1  # in `JumpPath.channels`: the run was put back to its initial state; not an event
# In `JumpPath.partners`, if it is not the number of a species: a wall alone; several bodies, or bodies and walls, at
# once; not a break; a break of which nobody knows. Stored records hold these numbers: they stay as they are.
BY_WALL, BY_SEVERAL, NO_BREAK, BY_UNKNOWN = -1, -2, -3, -4


@dataclass(frozen=True, eq=False, repr=False)
class JumpPath(Shown, Tabular):
    """A jump path: every event of one run, in order.

    initial : (S,) counts at time 0, and again after each restart
    times : (E,) in tu, never falling; events within one mechanics step share their time
    channels : (E,) index of the channel that fired, or RESTART
    end : time in tu at which observation stopped; a waiting time cut off by it is right-censored
    open_channels : (R,) bool, channels that could fire at all in this run; all of them by default
    tank : where it happened; None if that is not known
    partners : (E,) who broke a structure: number of a species, BY_WALL, BY_SEVERAL or BY_UNKNOWN; NO_BREAK for other
        events and restarts. None if nobody watched for it
    resolution : time between two looks, tu, where an event is written down at the look that first shows it; 0 if
        every event has its own time
    ValueError: arrays of other shapes, times that fall, or an event whose reactants were not there

    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> path = JumpPath(decay, {"A": 2}, times=[0.5, 1.5], channels=[0, 0], end=3.0)
    >>> path.at([0.0, 1.0, 2.0])[:, 0].tolist()
    [2, 1, 0]
    """

    network: Network
    initial: Ints
    times: Floats
    channels: Ints
    end: float
    open_channels: NDArray[np.bool_] = None  # type: ignore[assignment]  # an array once constructed
    tank: Tank | None = None
    partners: Ints | None = None
    resolution: float = 0.0

    def __post_init__(self) -> None:
        n_channels = len(self.network.channels)
        initial, times = self.network.state(self.initial), rising_times(self.times, strictly=False)
        set_fields(
            self,
            initial=initial,
            times=times,
            channels=integers("channels", self.channels, times.shape, RESTART),
            end=float(reals("end", self.end, (), minimum=0)),
            resolution=float(reals("resolution", self.resolution, (), minimum=0)),
        )
        if self.channels.size and self.channels.max() >= n_channels:
            raise ValueError(f"channels holds {self.channels.max()}; the network has only {n_channels}")
        if self.times.size and self.times[-1] > self.end:
            raise ValueError(f"an event at {self.times[-1]:g} comes after the end, {self.end:g}")
        given = np.ones(n_channels, dtype=bool) if self.open_channels is None else self.open_channels
        is_open = np.array(given)
        if is_open.shape != (n_channels,) or is_open.dtype != bool:
            raise ValueError(f"open_channels must be {n_channels} truth values, one a channel")
        partners = self.partners
        if partners is not None:
            partners = integers("partners", partners, times.shape, BY_UNKNOWN)
            if partners.size and partners.max() >= len(self.network.species):
                raise ValueError(
                    f"partners holds {partners.max()}; the network has {len(self.network.species)} species"
                )
        set_fields(self, open_channels=read_only(is_open), partners=partners)
        self._check_events(is_open)

    @property
    def headline(self) -> str:
        """How much happened, and for how long."""
        restarts = int((self.channels == RESTART).sum())
        more = f" and {restarts} restarts" if restarts else ""
        end = in_unit(f"{self.end:g}", self.network.time_unit)
        return f"{self.channels.size - restarts} events{more} of {len(self.network.channels)} channels until {end}"

    def summary(self) -> ResultTable:
        """Counts at some of the times until the end."""
        times, network = np.linspace(0.0, self.end, MOST_TIMES) if self.end else np.zeros(1), self.network
        counts = self.at(times)
        return over_time(self.headline, times, network.time_unit, network.species, lambda t, s: str(counts[t, s]))

    def _check_events(self, is_open: NDArray[np.bool_]) -> None:
        """Every event must be possible: its channel open, its reactants there."""
        fired = np.flatnonzero(self.channels != RESTART)
        channels = self.channels[fired]
        closed = np.flatnonzero(~is_open[channels])
        if closed.size:
            raise ValueError(f"channel {self.network.channels[channels[closed[0]]]!r} fired but is not open")
        needs = self.network.sparse_reactants
        owners, entries = needs.entries_of(channels)
        events, species, needed = fired[owners], needs.columns[entries], needs.copies[entries]
        there = self._counts_before(events, species)
        short = np.flatnonzero(there < needed)
        if short.size:
            first = short[0]
            raise ValueError(
                f"event {events[first]} ({self.network.channels[self.channels[events[first]]]} at "
                f"{self.times[events[first]]:g}) needs {needed[first]} of {self.network.species[species[first]]!r}; "
                f"there are {there[first]}"
            )

    def _counts_before(self, events: NDArray[np.intp], species: Ints) -> Ints:
        """Counts (n,) of one species each, just before one event each."""
        if self._is_small:
            return self.states[events, species]
        # All that ever changes, and the questions after it, in order of stretch between restarts, species and event.
        fired = np.flatnonzero(self.channels != RESTART)
        owners, entries = self.network.sparse_stoichiometry.entries_of(self.channels[fired])
        gains = self.network.sparse_stoichiometry.copies[entries]
        when = np.concatenate([fired[owners] + 1, events])  # an event counts from the next row on
        who = np.concatenate([self.network.sparse_stoichiometry.columns[entries], species])
        gained = np.concatenate([gains, np.zeros_like(species)])
        is_question = np.repeat([False, True], [gains.size, species.size])
        stretch = self._last_restart[np.concatenate([fired[owners], events])]
        order = np.lexsort((is_question, when, who, stretch))
        total = np.cumsum(gained[order])
        is_first = np.append(True, (np.diff(stretch[order]) != 0) | (np.diff(who[order]) != 0))[: order.size]
        before = (total - gained[order])[is_first][np.cumsum(is_first) - 1]
        counts = np.empty(order.size, dtype=np.int64)
        counts[order] = total - before
        return self.initial[species] + counts[gains.size :]

    @property
    def _is_small(self) -> bool:
        return (self.channels.size + 1) * len(self.network.species) <= MAX_STATES

    @cached_property
    def _last_restart(self) -> Ints:
        """Row (E + 1,) of `states` at which each stretch between restarts begins."""
        restarts = np.flatnonzero(self.channels == RESTART) + 1
        last = np.zeros(self.channels.size + 1, dtype=np.int64)
        last[restarts] = restarts
        return np.maximum.accumulate(last)  # row 0, without any gain, where there was none yet

    @cached_property
    def states(self) -> Ints:
        """Counts (E + 1, S): the initial ones, then those after each event or restart."""
        if not self._is_small:
            raise ValueError(
                f"{self.channels.size} events of {len(self.network.species)} species make a table of over "
                f"{MAX_STATES} counts; ask for the counts `at` some times instead"
            )
        changes = np.zeros((self.channels.size + 1, len(self.network.species)), dtype=np.int64)
        is_event = self.channels != RESTART
        owners, entries = self.network.sparse_stoichiometry.entries_of(self.channels[is_event])
        rows = np.flatnonzero(is_event)[owners] + 1
        changes[rows, self.network.sparse_stoichiometry.columns[entries]] = self.network.sparse_stoichiometry.copies[
            entries
        ]
        total = np.cumsum(changes, axis=0)
        return read_only(self.initial + total - total[self._last_restart])  # a restart takes back all gained up to it

    def at(self, times: ArrayLike) -> Ints:
        """Counts (T, S) at times (T,) between 0 and `end`; at an event's own time, those after it."""
        asked = reals("times", times, (None,), minimum=0)
        if asked.size and asked.max() > self.end:
            raise ValueError(f"the run was observed until {self.end:g}; {asked.max():g} was requested")
        rows = np.searchsorted(self.times, asked, side="right")
        if self._is_small:
            return self.states[rows]
        change = self.network.sparse_stoichiometry
        counts = np.tile(self.initial, (rows.size, 1))
        for state, row in zip(counts, rows, strict=True):
            fired = np.bincount(self.channels[self._last_restart[row] : row], minlength=len(self.network.channels))
            np.add.at(state, change.columns, change.copies * fired[change.rows])
        return counts

    def first_time(self, species: str, copies: int = 1) -> float:
        """First-passage time in tu to `copies` of a species; nan if it is not reached by `end`."""
        rows = np.arange(self.channels.size + 1)
        counts = self._counts_before(rows, np.full(rows.size, self.network.index(species)))
        seen = np.flatnonzero(counts >= copies)
        if not seen.size:
            return float("nan")
        return 0.0 if seen[0] == 0 else float(self.times[seen[0] - 1])

    def to_dataframe(self) -> pd.DataFrame:
        """One row per moment: time in tu, event ("start", a channel, "restart", "end"), counts after it."""
        names = (*self.network.channels, "restart")  # RESTART = -1 picks the last
        happened = ["start", *(names[channel] for channel in self.channels), "end"]
        counts = np.vstack([self.states, self.states[-1:]])
        table = {"time": np.concatenate([[0.0], self.times, [self.end]]), "event": happened}
        return dataframe(table | dict(zip(self.network.species, counts.T, strict=True)))

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Counts of every species against time, as steps; returns `ax`."""
        times = np.concatenate([[0.0], self.times, [self.end]])
        return plots.steps(
            ax, times, np.vstack([self.states, self.states[-1:]]), self.network.species, self.network.time_unit
        )


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Shown, Tabular):
    """The counts of many independent runs on one grid of times.

    times : (T,) in tu, rising
    counts : (runs, T, S) int64
    method : that made the runs; "" if that is not known
    truncated : why there are fewer times than were asked for; None if there are not
    ValueError: counts of another shape or kind, or negative ones

    >>> import numpy as np
    >>> from kinetics import Ensemble, Network
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> runs = Ensemble(decay, [0.0, 1.0], np.array([[[4], [2]], [[4], [3]], [[4], [4]]]))
    >>> runs["A"].tolist(), runs.mean()[:, 0].tolist(), runs.sd()[:, 0].tolist()
    ([[4, 2], [4, 3], [4, 4]], [4.0, 3.0], [0.0, 1.0])
    """

    network: Network
    times: Floats
    counts: Ints
    method: str = ""
    truncated: Truncation | None = None

    def __post_init__(self) -> None:
        times, counts = rising_times(self.times), np.asarray(self.counts)
        expected = (times.size, len(self.network.species))
        if counts.ndim != 3 or counts.shape[1:] != expected or counts.shape[0] == 0:
            raise ValueError(f"counts have shape {counts.shape}; expected (runs, {expected[0]}, {expected[1]})")
        if counts.dtype != np.int64 or counts.min(initial=0) < 0:
            raise ValueError(f"counts must be int64 and not negative; {counts.dtype} came")
        # A view, so that closing it for writing costs no copy of what may be gigabytes.
        set_fields(self, times=times, counts=read_only(counts.view()))

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.counts)

    @overload
    def __getitem__(self, what: str) -> Ints: ...

    @overload
    def __getitem__(self, what: slice) -> Ensemble: ...

    def __getitem__(self, what: str | slice) -> Ints | Ensemble:
        """By a species its counts (runs, T); by times `begin:end`, both included, the same runs at these alone."""
        if isinstance(what, str):
            return self.counts[:, :, self.network.index(what)]
        if not isinstance(what, slice) or what.step is not None:
            raise TypeError(f'{what!r}: expected a species, as in runs["AB"], or times, as in runs[10:50]')
        ends = (-np.inf if what.start is None else what.start, np.inf if what.stop is None else what.stop)
        begin, end = (real_number("time", each) for each in ends)
        kept = (self.times >= begin) & (self.times <= end)
        if not kept.any():
            last = f"{self.times[0]:g} to {self.times[-1]:g}" if self.times.size else "none"
            raise ValueError(f"no time from {begin:g} to {end:g}; there are times from {last}")
        return Ensemble(self.network, self.times[kept], self.counts[:, kept], self.method, self.truncated)

    def __contains__(self, name: object) -> bool:
        """Whether it has a species of this name."""
        return name in self.network.species

    def __iter__(self) -> Iterator[str]:
        """The names of its species, as of a table's columns."""
        return iter(self.network.species)

    @property
    def headline(self) -> str:
        """How much it holds."""
        size = f"{self.runs} runs of {len(self.network.species)} species at {self.times.size} times"
        return f"{size}; method {self.method}" if self.method else size

    def summary(self) -> ResultTable:
        """Mean and standard deviation of a run, at some of the times."""
        note = f"mean ± sd of a run; {precision_of(self.standard_error())}"
        if self.truncated is not None:
            note += f"; {self.truncated}"
        network = self.network
        return means_over_time(
            self.headline, self.times, network.time_unit, network.species, self.mean(), self.sd(), note
        )

    def mean(self) -> Floats:
        """Mean counts (T, S)."""
        return np.asarray(self.counts.mean(axis=0))

    def sd(self) -> Floats:
        """Standard deviation (T, S) among the runs, with runs - 1; nan for a single run."""
        if self.runs == 1:
            return np.full(self.counts.shape[1:], np.nan)
        return np.asarray(self.counts.std(axis=0, ddof=1))

    def variance(self) -> Floats:
        """Variance (T, S) among the runs, with runs - 1; nan for a single run."""
        return self.sd() ** 2

    def standard_error(self) -> Floats:
        """Standard error (T, S) of the mean; nan for a single run."""
        return self.sd() / math.sqrt(self.runs)

    def covariance(self) -> Floats:
        """Covariances (T, S, S) of the species at each time, with runs - 1; nan for a single run."""
        if self.runs == 1:
            return np.full((*self.counts.shape[1:], self.counts.shape[2]), np.nan)
        means = self.mean()
        tables = []
        for t, mean in enumerate(means):  # one time after the other: deviations of all would double the memory
            off = self.counts[:, t] - mean
            tables.append(off.T @ off / (self.runs - 1))
        return np.array(tables)

    def marginal(self, species: str) -> Floats:
        """Shares (T, M + 1) of the runs with 0, 1, ..., M copies of one species."""
        columns = self.counts[:, :, self.network.index(species)].T
        top = int(columns.max())
        return np.array([np.bincount(column, minlength=top + 1) for column in columns]) / self.runs

    def quantile(self, q: float) -> Floats:
        """Quantiles (T, S): the smallest counts with at least a share q of the runs at or below them."""
        if not 0 <= q <= 1:
            raise ValueError(f"q = {q}; expected a probability")
        return np.quantile(self.counts.astype(np.float64), q, axis=0, method="inverted_cdf")

    def to_dataframe(self) -> pd.DataFrame:
        """One row per run and time: run, time in tu, counts."""
        runs = np.repeat(np.arange(self.runs), self.times.size)
        table = {"run": runs, "time": np.tile(self.times, self.runs)}
        columns = self.counts.reshape(-1, len(self.network.species)).T
        return dataframe(table | dict(zip(self.network.species, columns, strict=True)))

    def to_xarray(self) -> xr.Dataset:
        """The counts, with dimensions run, time and species."""
        places = {"run": np.arange(self.runs), "time": self.times, "species": list(self.network.species)}
        counts = {"counts": (("run", "time", "species"), self.counts)}
        return dataset(counts, places, self.network.time_unit, method=self.method)

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Plot the means, with bands of the middle 95 % of the runs; returns `ax`."""
        low, high = self.quantile(0.025), self.quantile(0.975)
        return plots.bands(ax, self.times, self.mean(), low, high, self.network.species, self.network.time_unit)
