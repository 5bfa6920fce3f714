"""`PanelData`: runs of which counts were seen at some times."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.panels.observations import Censored, Exact, Observation
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints
from kinetics.support.frozen import set_fields

Mask = NDArray[np.bool_]
MOST_OFF = 1e-9  # by which the sum of chances may differ from 1


@dataclass(frozen=True, eq=False)
class PanelRun:
    """What was seen of one run, and when.

    initial : counts at the start, (S,), or of each state in which it may start, (M, S); kept as (M, S)
    times : (n,) tu, of the looks, rising
    seen : (n, C) the number in each column; nan where none was written down
    start : tu, on the same clock
    fired : (n,) place in `PanelData.events` of the event that happened at exactly that time, just before the look; -1
        for none. None: no times of events are known
    where : (n,) what names each look in an error; None: its time does
    chances : (M,) the probability of each state in which it may start; None: there is one

    ValueError: times that do not rise, shapes that do not fit, or chances that do not sum to 1

    >>> from kinetics.markov.panels import PanelRun
    >>> run = PanelRun([10, 0], times=[0.5, 2.0], seen=[[7], [3]])  # one column, two looks
    >>> run.times.tolist(), run.fired.tolist(), run.named(1)
    ([0.5, 2.0], [-1, -1], 'time 2')
    """

    initial: Ints
    times: Floats
    seen: Floats
    start: float = 0.0
    fired: Ints | None = None
    where: Sequence[str] | None = None
    chances: Floats = None  # type: ignore[assignment]  # always there after `__post_init__`

    def __post_init__(self) -> None:
        initial = np.atleast_2d(np.asarray(self.initial, dtype=np.int64))
        times = np.asarray(self.times, dtype=np.float64)
        seen = np.asarray(self.seen, dtype=np.float64)
        fired = np.full(times.size, -1) if self.fired is None else np.asarray(self.fired, dtype=np.int64)
        if seen.ndim != 2 or not len(seen) == times.size == fired.size:
            raise ValueError(f"{times.size} times, {fired.size} events and numbers of shape {seen.shape} do not fit")
        before = np.concatenate([[self.start], times])[:-1]
        wrong = ~(times > before)
        if times.size and fired[0] < 0:
            wrong[0] = not times[0] >= self.start  # a look at once: of a start that is not certain
        if wrong.any():
            late = int(wrong.argmax())
            named = f"{self.where[late]}: " if self.where is not None else ""
            raise ValueError(f"{named}time {times[late]:g} does not come after {before[late]:g}; sort the rows by time")
        chances = np.ones(1) if self.chances is None else np.asarray(self.chances, dtype=np.float64)
        if chances.shape != (len(initial),) or not (chances > 0.0).all() or abs(chances.sum() - 1.0) > MOST_OFF:
            raise ValueError(
                f"{len(initial)} states to start in, with chances {chances.tolist()}; expected one each, above 0, that "
                f"sum to 1"
            )
        set_fields(self, initial=initial, times=times, seen=seen, fired=fired, chances=chances)

    @cached_property
    def lengths(self) -> Floats:
        """Time (n,), tu, before each look: between decimal numbers as they are written, so that .3 less .2 is .1."""
        written = [Decimal(repr(time)) for time in [float(self.start), *self.times.tolist()]]
        return np.array([float(after - before) for before, after in pairwise(written)])

    def part(self, first: int, last: int, initial: Ints, chances: Floats) -> PanelRun:
        """The looks from `first` to before `last`, from the states that were possible before."""
        start = float(self.times[first - 1]) if first else self.start
        chosen = slice(first, last)
        where = None if self.where is None else self.where[chosen]
        fired = self.fired[chosen]  # type: ignore[index]
        return PanelRun(initial, self.times[chosen], self.seen[chosen], start, fired, where, chances)

    def named(self, look: int) -> str:
        """How an error calls a look."""
        return f"time {self.times[look]:g}" if self.where is None else self.where[look]


@dataclass(frozen=True, eq=False)
class PanelData:
    """Runs of which counts were seen at some times; nothing is known of what happened in between.

    columns : name -> weight of each species in what the column counts; by a name alone, that species
    runs : independent of each other, each conditional on its start
    observations : column -> how its numbers come from true counts; `Exact` for those not named
    events : the channels one of which an event stands for whose time is known exactly. They are recorded whenever they
        fire: between two looks none of them did

    ValueError: no runs, columns that do not fit, or a number that cannot be observed so

    >>> from kinetics import Network
    >>> from kinetics.markov.panels import PanelData, PanelRun, log_likelihood
    >>> switch = Network.from_text("A <-> B, 2, 3")
    >>> data = PanelData({"A": {"A": 1}}, [PanelRun([1, 0], [0.5, 1.0], [[0], [0]])])
    >>> found = log_likelihood(switch, data)  # 2/5 (1 - exp(-5/2)), and 1 - 3/5 (1 - exp(-5/2))
    >>> round(found.value, 12), found.high - found.low < 1e-11
    (-1.802114744843, True)
    """

    columns: Mapping[str, Mapping[str, float]]
    runs: Sequence[PanelRun]
    observations: Mapping[str, Observation] = field(default_factory=dict)
    events: Sequence[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        if not self.runs:
            raise ValueError("no runs: there is nothing to learn from")
        for name in self.observations:
            if name not in self.columns:
                raise ValueError(f"no column {name!r} to be observed; columns are {', '.join(self.columns)}")
        for run in self.runs:
            if run.seen.shape[1] != len(self.columns):
                raise ValueError(f"a run has {run.seen.shape[1]} columns; expected {len(self.columns)}")
        kept = {name: self.observations.get(name, Exact()) for name in self.columns}
        set_fields(self, observations=kept, runs=tuple(self.runs), events=tuple(self.events))
        for column, (name, observation) in enumerate(kept.items()):
            possible: dict[float, None] = {}
            for run in self.runs:
                for look in np.flatnonzero(~np.isnan(run.seen[:, column])).tolist():
                    seen = float(run.seen[look, column])
                    if seen not in possible:
                        try:
                            observation.support(seen)
                        except ValueError as error:
                            raise ValueError(f"{run.named(look)}, column {name}: {error}") from None
                        possible[seen] = None

    def weights(self, network: Network) -> Floats:
        """Weights (C, S) of the species in each column. ValueError: a species that the network lacks"""
        table = np.zeros((len(self.columns), len(network.species)))
        for row, weights in zip(table, self.columns.values(), strict=True):
            for name, weight in weights.items():
                row[network.index(name)] = weight
        return table

    def with_observed(self, **parameters: float) -> PanelData:
        """These data, with other parameters in the observation models of some columns: `with_observed(A=0.7)`."""
        changed: dict[str, Any] = dict(self.observations)
        for name, value in parameters.items():
            changed[name] = changed[name].with_parameter(value)
        return PanelData(self.columns, self.runs, changed, self.events)

    def told_states(self, network: Network, run: PanelRun) -> tuple[Mask, Ints]:
        """Which looks (n,) at a run tell its whole state, each species having a column of its own, and these (n, S)."""
        weights = self.weights(network)
        known = ~np.isnan(run.seen)
        for column, observation in enumerate(self.observations.values()):
            if isinstance(observation, Censored):
                known[:, column] &= ~np.isin(run.seen[:, column], list(observation.intervals))
            elif not isinstance(observation, Exact):
                known[:, column] = False
        alone = (weights == 1.0) & (np.count_nonzero(weights, axis=1) == 1)[:, None]
        column_of = alone.argmax(axis=0)
        is_told = known[:, column_of].all(axis=1) & alone.any(axis=0).all()
        return is_told, np.where(is_told[:, None], run.seen[:, column_of], 0.0).astype(np.int64)

    @property
    def looks(self) -> int:
        """Looks in all runs."""
        return sum(run.times.size for run in self.runs)

    @property
    def digest(self) -> str:
        """SHA-256 of what was seen, by column and time, and of events at known times."""
        found = hashlib.sha256(repr((tuple(self.columns), self.events)).encode())
        for each in self.observations.values():
            if isinstance(each, Censored):
                found.update(repr(sorted(each.intervals.items())).encode())
        for run in self.runs:
            found.update(np.float64(run.start).tobytes())
            for array in (run.times, run.seen, run.fired):
                found.update(np.asarray(array).tobytes())
        return found.hexdigest()
