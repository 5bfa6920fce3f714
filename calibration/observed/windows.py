"""Observation windows and initial counts of runs: from marked rows, or from a table of the runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.observed.tables import Table, near
from kinetics.network import Network, Tank
from kinetics.rates.breaks import base_channel
from kinetics.runs.event_tables import BETWEEN, END, RUN_COLUMNS, START
from kinetics.support.arrays import Ints


@dataclass(frozen=True)
class Given:
    """Facts about all runs that are given beside the tables.

    cubes : what every run holds; None if not given
    single : species of which runs without given counts start with one copy for each cube
    """

    network: Network
    cubes: int | None = None
    single: str | None = None
    tank: Tank | None = None

    def species(self, table: Table) -> list[str]:
        """The species that have a column."""
        return [name for name in self.network.species if name in table.columns]

    def check_titles(self, table: Table, known: Sequence[str]) -> None:
        """ValueError for a column that is neither known nor a species."""
        for title in table.columns:
            if title not in known and title not in self.network.species_places:
                raise ValueError(
                    f"{table.name}: column {title!r} is neither one of {', '.join(known)} nor a species"
                    f"{near(title, [*known, *self.network.species])}"
                )

    def channel(self, name: str, where: str, *words: str) -> int:
        """Position of a channel by its name; `words` may stand in its place."""
        if name not in self.network.channel_places:
            name = base_channel(name)  # a simulation under a break model says who broke what
        if name not in self.network.channel_places:
            raise ValueError(f"{where}: unknown channel {name!r}{near(name, [*self.network.channels, *words])}")
        return self.network.channel_places[name]

    def counts(self, table: Table, row: int) -> dict[str, int] | None:
        """Counts in a row, of the species that have a column; None if no cell is filled."""
        titles = self.species(table)
        counts = table.counts(titles, np.array([row]))[0]
        if np.isnan(counts).all():
            return None
        if np.isnan(counts).any():
            empty = titles[int(np.isnan(counts).argmax())]
            raise ValueError(f"{table.where(row)}: the cell of {empty} is empty; write 0 if there are none")
        return dict(zip(titles, counts.astype(np.int64).tolist(), strict=True))

    def initial(self, table: Table, row: int) -> Ints:
        """Counts (S,) at the start that a row tells of, a species without a column having none."""
        said = self.counts(table, row)
        if said is None:
            if self.single is None or self.cubes is None:
                raise ValueError(
                    f"{table.where(row)}: no counts at the start of this run; give a column for each species that is "
                    "there, or, for a rule book whose runs start from single cubes, their number, as in --cubes 60"
                )
            said = {self.single: self.cubes}
        initial = self.network.state(said)
        if self.cubes is not None:
            if "cubes" not in self.network.conserved:
                raise ValueError(
                    f"--cubes {self.cubes}: this network does not say how many cubes a species has; leave it out"
                )
            held = float(initial @ self.network.conserved["cubes"])
            if held != self.cubes:
                raise ValueError(
                    f"{table.where(row)}: this run starts with {held:g} cubes; expected {self.cubes}, as --cubes says"
                )
        return initial


@dataclass(frozen=True, eq=False)
class ObservationWindow:
    """How one run was observed.

    where : the row that says so
    start, end : tu, on the clock of the table
    initial : (S,) at the start
    final : at the end, of the species of which that is stated; None if nothing is
    is_open : (R,) bool, channels that could fire
    resolution : tu within which events share a time
    """

    where: str
    start: float
    end: float
    initial: Ints
    is_open: NDArray[np.bool_]
    final: Mapping[str, int] | None = None
    tank: Tank | None = None
    resolution: float = 0.0

    def __post_init__(self) -> None:
        if self.end <= self.start:
            raise ValueError(f"{self.where}: it ends at {self.end:g} and starts at {self.start:g}; the end comes later")


def windows_of_rows(given: Given, events: Table) -> dict[str, ObservationWindow]:
    """Observation windows of all runs, from rows of `events` that are marked start and end."""
    starts, ends = (_marked(events, word) for word in (START, END))
    windows = {}
    for run in dict.fromkeys(events.columns["run"]):
        for word, rows in ((START, starts), (END, ends)):
            if run not in rows:
                raise ValueError(
                    f"{events.name}: run {run or 'without a name'} has no {word}; add a row with {word} in the column "
                    "channel, or give a table of runs"
                )
        both = np.array([starts[run], ends[run]])
        mine = np.flatnonzero(events.columns["run"] == run)
        if (mine[0], mine[-1]) != (starts[run], ends[run]):
            raise ValueError(f"{events.where(both[0])}: the start must be the first row of a run and the end its last")
        start, end = events.numbers("time", both)
        is_open = np.ones(len(given.network.channels), bool)
        initial, final = given.initial(events, starts[run]), given.counts(events, ends[run])
        windows[run] = ObservationWindow(events.where(starts[run]), start, end, initial, is_open, final, given.tank)
    return windows


def windows_of_table(given: Given, events: Table, runs: Table) -> dict[str, ObservationWindow]:
    """Observation windows of all runs, from a table of the runs."""
    runs.require("run", "start", "end")
    given.check_titles(runs, RUN_COLUMNS)
    for word in (START, END):
        for row in _marked(events, word).values():
            raise ValueError(f"{events.where(row)}: {runs.name} says when runs start and end; leave this row out")
    if given.tank is not None and "tank" in runs.columns:
        raise ValueError(f"both --tank and the column tank of {runs.name} say how large a tank is; give one of them")
    windows: dict[str, ObservationWindow] = {}
    rows = np.arange(len(runs))
    start, end = runs.numbers("start", rows), runs.numbers("end", rows)
    resolution = np.zeros(len(runs))
    if "resolution" in runs.columns:
        resolution = np.nan_to_num(runs.numbers("resolution", rows, may_be_empty=True))
    for row in range(len(runs)):
        run, where = runs.columns["run"][row], runs.where(row)
        if not run or run in windows:
            raise ValueError(f"{where}: {'a second row of this run' if run else 'the run is not named'}")
        if resolution[row] < 0 or start[row] + resolution[row] > end[row] > start[row]:
            long = end[row] - start[row]
            raise ValueError(f"{where}: resolution = {resolution[row]:g}; expected a time from 0 to the run's {long:g}")
        said = runs.columns["tank"][row].split() if "tank" in runs.columns else ()
        windows[run] = ObservationWindow(
            where,
            float(start[row]),
            float(end[row]),
            given.initial(runs, row),
            _open(given, runs, row),
            tank=_tank(said, where) if said else given.tank,
            resolution=float(resolution[row]),
        )
    return windows


def _tank(lengths: Sequence[str], where: str) -> Tank:
    try:
        return Tank(tuple(map(float, lengths)))  # type: ignore[arg-type]  # the tank checks how many there are
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error


def _marked(events: Table, word: str) -> Mapping[str, int]:
    """Run -> its row that is marked by this word."""
    rows: dict[str, int] = {}
    for row in np.flatnonzero(events.columns.get("channel", np.array([])) == word).tolist():
        run = events.columns["run"][row]
        if run in rows:
            raise ValueError(f"{events.where(row)}: a second {word} of this run; a run has one")
        rows[run] = row
    return rows


def _open(given: Given, runs: Table, row: int) -> NDArray[np.bool_]:
    """Channels (R,) that a row does not call closed."""
    is_open = np.ones(len(given.network.channels), bool)
    for name in runs.columns["closed"][row].split(BETWEEN) if "closed" in runs.columns else ():
        if name.strip():
            is_open[given.channel(name.strip(), runs.where(row))] = False
    return is_open
