"""Panel data from tables that others wrote: counts at times, or snapshots of independent copies.

The format is described in docs/your_data.md. Nothing is repaired or guessed: a row that cannot be is an error
that says where it stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.observed.intervals import with_intervals
from calibration.observed.starts import StartDistribution, read_starts
from calibration.observed.tables import Table, near, read_table
from calibration.observed.time_units import timed
from kinetics.markov.panels import PanelData, PanelRun
from kinetics.markov.panels.observations import Censored, Exact, Observation
from kinetics.network import Model, Network
from kinetics.runs.event_tables import BETWEEN
from kinetics.support.arrays import Floats

WORDS = ("run", "time", "event")
LONG = ("time", "species", "count")  # titles of a table with one number in each row
Rows = NDArray[np.intp]


def read_counts(
    model: Model | Network,
    path: str | Path | Table,
    observations: Mapping[str, Observation] | None = None,
    initial: str | Path | Table | None = None,
) -> PanelData:
    """Counts of species or observables at times; each run starts from its first row, on which all else is conditional.

    path : table (CSV or Parquet) with the columns `time`, one for each species or observable that was counted (an
        empty cell was not looked at), `run` if there are several, and `event` where the times of some events are
        exact: a channel, or several that cannot be told apart, between semicolons. Or a long one, with the columns
        `time`, `species` and `count`. A cell may be an interval: `3..5`, `>=10`, `<=2`
    observations : column -> how its numbers come from true counts; exact for those not named
    initial : table of the states in which a run may start, `read_starts`; the first row is then a look like the others

    What no column of the first row states starts as in the model. Where a column is not exact, or counts several
    species, the whole start is that of the model, and the first row is a look like the others.

    ValueError: a table that cannot be read, an unknown column, or a row that cannot be
    """
    return _CountsReader.of(Model.of(model), path, observations or {}, initial).panels()


def read_snapshots(
    model: Model | Network,
    path: str | Path | Table,
    observations: Mapping[str, Observation] | None = None,
    initial: str | Path | Table | None = None,
) -> PanelData:
    """Counts of independent copies, each seen once: one a row, which starts from the model's counts at time 0.

    path, observations, initial : as for `read_counts`, without `run` and `event`

    ValueError: as of `read_counts`
    """
    return _CountsReader.of(Model.of(model), path, observations or {}, initial).snapshots()


@dataclass(frozen=True, eq=False)
class _CountsReader:
    """A table of counts as panel data of a model."""

    model: Model
    table: Table
    observations: dict[str, Observation]
    starts: StartDistribution | None

    @classmethod
    def of(
        cls,
        model: Model,
        path: str | Path | Table,
        observations: Mapping[str, Observation],
        initial: str | Path | Table | None,
    ) -> _CountsReader:
        """A table in the time unit of the model, with a column for each species."""
        table = _wide(timed(read_table(path), model.network.time_unit))
        counted = [title for title in table.columns if title not in WORDS]
        starts = None if initial is None else read_starts(model, initial)
        return cls(model, *with_intervals(table, counted, observations), starts)

    def __post_init__(self) -> None:
        self.table.require("time")
        known = [*self.model.network.species, *self.model.observables]
        for title in self.table.columns:
            if title not in (*WORDS, *known):
                raise ValueError(
                    f"{self.table.name}: column {title!r} is neither one of {', '.join(WORDS)} nor a species or an "
                    f"observable of the network{near(title, [*WORDS, *known])}"
                )
        words = [name for name in WORDS if name in known]
        if words:
            raise ValueError(f"the network calls something {words[0]!r}, which means something else here: rename it")
        if not self.titles:
            raise ValueError(f"{self.table.name} counts nothing; give a column for a species{near('', known)}")

    @property
    def titles(self) -> list[str]:
        """Columns that hold counts."""
        return [title for title in self.table.columns if title not in WORDS]

    @property
    def columns(self) -> dict[str, Mapping[str, float]]:
        """What each of them counts."""
        return {title: self.model.observables.get(title, {title: 1.0}) for title in self.titles}

    def panels(self) -> PanelData:
        """Runs that are looked at again and again."""
        events: dict[tuple[str, ...], int] = {}
        fired = np.array([self.event(row, events) for row in range(len(self.table))], dtype=np.int64)
        names = self.table.columns.get("run", np.array([""] * len(self.table)))
        runs = []
        for name in dict.fromkeys(names.tolist()):
            rows = np.flatnonzero(names == name)
            times, seen = self.table.numbers("time", rows), self.numbers(rows)
            starts, is_start = self.start(int(rows[0]), seen[0])
            if is_start and rows.size == 1:
                continue  # a start after which nothing was seen says nothing
            if is_start and times[1] == times[0]:
                raise ValueError(f"{self.table.where(int(rows[1]))}: a second row at time {times[1]:g}")
            if is_start and fired[rows[0]] >= 0:
                raise ValueError(
                    f"{self.table.where(int(rows[0]))}: an event in the first row of a run; it starts there"
                )
            kept = slice(1, None) if is_start else slice(None)
            where = [self.table.where(row) for row in rows[kept].tolist()]
            looks = times[kept], seen[kept], float(times[0]), fired[rows][kept]
            runs.append(PanelRun(starts.states, *looks, where, starts.chances))
        if not runs:
            raise ValueError(f"{self.table.name}: every run has one row, its start, and nothing is seen after it")
        return PanelData(self.columns, runs, self.observations, list(events))

    def snapshots(self) -> PanelData:
        """Copies that are looked at once."""
        for word in ("run", "event"):
            if word in self.table.columns:
                raise ValueError(f"{self.table.name}: a column {word!r} in snapshots, each of which is a row; leave it")
        rows = np.arange(len(self.table))
        times, seen = self.table.numbers("time", rows), self.numbers(rows)
        if (times < 0).any():
            raise ValueError(f"{self.table.where(int((times < 0).argmax()))}: a snapshot before time 0, the start")
        starts = self.starts or StartDistribution.certain(self.model.initial)
        runs = [
            PanelRun(starts.states, times[[i]], seen[[i]], where=[self.table.where(i)], chances=starts.chances)
            for i in rows.tolist()
        ]
        return PanelData(self.columns, runs, self.observations)

    def numbers(self, rows: Rows) -> Floats:
        """What each column says (n, C); nan for an empty cell."""
        return np.column_stack([self.table.numbers(title, rows, may_be_empty=True) for title in self.titles])

    def start(self, row: int, seen: Floats) -> tuple[StartDistribution, bool]:
        """In which states a run may start, and whether its first row states it."""
        if self.starts is not None:
            return self.starts, False
        initial = np.array(self.model.initial)
        known = list(zip(self.titles, seen.tolist(), strict=True))
        if any(title in self.model.observables or self.is_doubtful(title, value) for title, value in known):
            return StartDistribution.certain(initial), False
        for title, value in known:
            if np.isnan(value):
                continue
            if value < 0 or value != int(value):
                raise ValueError(
                    f"{self.table.where(row)}: {value:g} copies of {title}; expected a whole number, 0 or more"
                )
            initial[self.model.network.index(title)] = int(value)
        return StartDistribution.certain(initial), True

    def is_doubtful(self, title: str, value: float) -> bool:
        """Whether a number in a column may have come from more than one count."""
        observation = self.observations.get(title, Exact())
        if isinstance(observation, Censored):
            return value in observation.intervals
        return not isinstance(observation, Exact)

    def event(self, row: int, events: dict[tuple[str, ...], int]) -> int:
        """The place among `events` of the one in a row, which it joins; -1 if there is none."""
        cell = self.table.columns["event"][row] if "event" in self.table.columns else ""
        if not cell:
            return -1
        places = self.model.network.channel_places
        names = tuple(name.strip() for name in cell.split(BETWEEN) if name.strip())
        for name in names:
            if name not in places:
                raise ValueError(f"{self.table.where(row)}: unknown channel {name!r}{near(name, list(places))}")
        return events.setdefault(names, len(events))


def _wide(table: Table) -> Table:
    """The table with a column for each species, where it is a long one."""
    if not {"species", "count"} <= set(table.columns):
        return table
    extra = set(table.columns) - {*LONG, "run"}
    if extra:
        raise ValueError(f"{table.name}: column {min(extra)!r} in a long table, which has run, time, species and count")
    table.require(*LONG)
    runs = table.columns.get("run", np.array([""] * len(table)))
    keys = list(zip(runs.tolist(), table.columns["time"].tolist(), strict=True))
    places = {key: place for place, key in enumerate(dict.fromkeys(keys))}
    names = list(dict.fromkeys(table.columns["species"].tolist()))
    cells = {name: np.array([""] * len(places), dtype=object) for name in names}
    lines = np.zeros(len(places), dtype=np.int64)
    for row, (key, name) in enumerate(zip(keys, table.columns["species"].tolist(), strict=True)):
        if cells[name][places[key]]:
            raise ValueError(f"{table.where(row)}: a second count of {name} at time {key[1]}")
        cells[name][places[key]] = table.columns["count"][row]
        lines[places[key]] = table.lines[row]
    first = np.array([list(places)[place][0] for place in range(len(places))], dtype=object)
    times = np.array([key[1] for key in places], dtype=object)
    head = {"run": first} if "run" in table.columns else {}
    return Table(table.name, {**head, "time": times, **cells}, lines)
