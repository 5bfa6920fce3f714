"""What happened: jump paths with every event, and ensembles of counts on a grid of times.

Simulated and mechanical runs give the same records, so that whoever reads one need not know where it came from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.arrays import Floats, Ints, integers, read_only, reals, rising_times
from kinetics.network import Network

if TYPE_CHECKING:
    import pandas as pd

RESTART = -1  # in `JumpPath.channels`: the run was put back to its initial state; not an event


@dataclass(frozen=True, eq=False)
class JumpPath:
    """Every event of one run, in order.

    initial : (S,) counts at time 0, and again after each restart
    times : (E,) in tu, never falling: what happens within one mechanics step shares its time
    channels : (E,) index of the channel that fired, or RESTART
    end : time in tu at which watching stopped; a wait that it cuts off is right-censored
    open_channels : (R,) bool, channels that could fire at all in this run; all of them by default
    """

    network: Network
    initial: Ints
    times: Floats
    channels: Ints
    end: float
    open_channels: NDArray[np.bool_] = None  # type: ignore[assignment]  # an array once constructed

    def __post_init__(self) -> None:
        n_channels = len(self.network.channels)
        object.__setattr__(self, "initial", self.network.state(self.initial))
        object.__setattr__(self, "times", rising_times(self.times, strictly=False))
        object.__setattr__(self, "channels", integers("channels", self.channels, self.times.shape, RESTART))
        object.__setattr__(self, "end", float(reals("end", self.end, (), minimum=0)))
        if self.channels.size and self.channels.max() >= n_channels:
            raise ValueError(f"channels holds {self.channels.max()}; the network has only {n_channels}")
        if self.times.size and self.times[-1] > self.end:
            raise ValueError(f"an event at {self.times[-1]:g} comes after the end, {self.end:g}")
        given = np.ones(n_channels, dtype=bool) if self.open_channels is None else self.open_channels
        is_open = np.array(given)
        if is_open.shape != (n_channels,) or is_open.dtype != bool:
            raise ValueError(f"open_channels must be {n_channels} truth values, one a channel")
        object.__setattr__(self, "open_channels", read_only(is_open))
        self._check_events(is_open)

    def _check_events(self, is_open: NDArray[np.bool_]) -> None:
        """Every event must be possible: its channel open, its reactants there."""
        fired = np.flatnonzero(self.channels != RESTART)
        channels = self.channels[fired]
        closed = np.flatnonzero(~is_open[channels])
        if closed.size:
            raise ValueError(f"channel {self.network.channels[channels[closed[0]]]!r} fired but is not open")
        short = np.argwhere(self.states[fired] < self.network.reactants[channels])
        if short.size:
            event, species = short[0]
            raise ValueError(
                f"event {fired[event]} ({self.network.channels[channels[event]]} at {self.times[fired[event]]:g}) "
                f"needs {self.network.reactants[channels[event], species]} of {self.network.species[species]!r}; "
                f"there are {self.states[fired[event], species]}"
            )

    @cached_property
    def states(self) -> Ints:
        """Counts (E + 1, S): the initial ones, then those after each event or restart."""
        changes = np.zeros((self.channels.size + 1, len(self.network.species)), dtype=np.int64)
        is_event = self.channels != RESTART
        changes[1:][is_event] = self.network.stoichiometry[self.channels[is_event]]
        total = np.cumsum(changes, axis=0)
        # A restart takes back all that was gained up to it.
        restarts = np.flatnonzero(self.channels == RESTART) + 1
        last = np.zeros(self.channels.size + 1, dtype=np.int64)
        last[restarts] = restarts
        last = np.maximum.accumulate(last)  # row 0, without any gain, where there was none yet
        return read_only(self.initial + total - total[last])

    def at(self, times: ArrayLike) -> Ints:
        """Counts (T, S) at times (T,) between 0 and `end`; at an event's own time, those after it."""
        asked = reals("times", times, (None,), minimum=0)
        if asked.size and asked.max() > self.end:
            raise ValueError(f"the run was watched until {self.end:g}; {asked.max():g} was asked for")
        return self.states[np.searchsorted(self.times, asked, side="right")]

    def first_time(self, species: str, copies: int = 1) -> float:
        """Time in tu at which there first were `copies` of a species; nan if not by `end`."""
        seen = np.flatnonzero(self.states[:, self.network.index(species)] >= copies)
        if not seen.size:
            return float("nan")
        return 0.0 if seen[0] == 0 else float(self.times[seen[0] - 1])

    def to_dataframe(self) -> pd.DataFrame:
        """One row a moment: time in tu, what happened ("start", a channel, "restart", "end"), counts after it."""
        import pandas as pd

        names = (*self.network.channels, "restart")  # RESTART = -1 picks the last
        happened = ["start", *(names[channel] for channel in self.channels), "end"]
        counts = np.vstack([self.states, self.states[-1:]])
        table = {"time": np.concatenate([[0.0], self.times, [self.end]]), "event": happened}
        return pd.DataFrame(table | dict(zip(self.network.species, counts.T, strict=True)))

    def plot(self, ax: Any) -> Any:
        """Counts of every species against time, as steps; returns `ax`."""
        from kinetics import plots

        times = np.concatenate([[0.0], self.times, [self.end]])
        return plots.steps(ax, times, np.vstack([self.states, self.states[-1:]]), self.network.species)


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Counts of many independent runs on one grid of times.

    times : (T,) in tu, rising
    counts : (runs, T, S) int64
    """

    network: Network
    times: Floats
    counts: Ints

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", rising_times(self.times))
        counts = np.asarray(self.counts)
        expected = (self.times.size, len(self.network.species))
        if counts.ndim != 3 or counts.shape[1:] != expected or counts.shape[0] == 0:
            raise ValueError(f"counts have shape {counts.shape}; expected (runs, {expected[0]}, {expected[1]})")
        if counts.dtype != np.int64 or counts.min(initial=0) < 0:
            raise ValueError(f"counts must be int64 and not negative; {counts.dtype} came")
        # A view, so that closing it for writing costs no copy of what may be gigabytes.
        object.__setattr__(self, "counts", read_only(counts.view()))

    @property
    def runs(self) -> int:
        """Number of runs."""
        return self.counts.shape[0]

    def mean(self) -> Floats:
        """Mean counts (T, S)."""
        return self.counts.mean(axis=0)

    def sd(self) -> Floats:
        """Standard deviation (T, S) among the runs, with runs - 1; nan for a single run."""
        if self.runs == 1:
            return np.full(self.counts.shape[1:], np.nan)
        return self.counts.std(axis=0, ddof=1)

    def standard_error(self) -> Floats:
        """Standard error (T, S) of the mean."""
        return self.sd() / np.sqrt(self.runs)

    def quantile(self, q: float) -> Floats:
        """Smallest counts (T, S) with at least a share q of the runs at or below them."""
        if not 0 <= q <= 1:
            raise ValueError(f"q = {q}; expected a probability")
        return np.quantile(self.counts.astype(float), q, axis=0, method="inverted_cdf")

    def to_dataframe(self) -> pd.DataFrame:
        """One row a run and time: run, time in tu, counts."""
        import pandas as pd

        runs = np.repeat(np.arange(self.runs), self.times.size)
        table = {"run": runs, "time": np.tile(self.times, self.runs)}
        columns = self.counts.reshape(-1, len(self.network.species)).T
        return pd.DataFrame(table | dict(zip(self.network.species, columns, strict=True)))

    def plot(self, ax: Any) -> Any:
        """Means with the band that holds the middle 95 % of runs; returns `ax`."""
        from kinetics import plots

        low, high = self.quantile(0.025), self.quantile(0.975)
        return plots.bands(ax, self.times, self.mean(), low, high, self.network.species)
