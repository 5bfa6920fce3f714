"""Jump paths from tables that others wrote: each row is checked against what the network lets happen.

The format is described in docs/observed_events.md; `kinetics.runs.event_tables` writes it. Nothing is repaired or
guessed: a row that cannot be, or that could be two things, is an error that says where it stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.observed.tables import Table, read_table
from calibration.observed.time_units import timed
from calibration.observed.windows import Given, ObservationWindow, windows_of_rows, windows_of_table
from kinetics.markov.panels import EventData
from kinetics.network import Network, Tank
from kinetics.rates.breaks import is_break
from kinetics.runs import BY_SEVERAL, BY_UNKNOWN, BY_WALL, NO_BREAK, RESTART, JumpPath
from kinetics.runs.event_tables import BETWEEN, END, EVENT_COLUMNS, NOTES, RESTARTED, RUN_COLUMNS, START
from kinetics.support.arrays import Floats, Ints

Rows = NDArray[np.intp]
Change = tuple[tuple[int, int], ...]  # species and what it gains, in order
UNNAMED = -2  # a row that names no channel; RESTART is -1
NEAREST = 3  # channels that are shown where none fits


def read_observed(
    network: Network,
    events: str | Path | Table,
    runs: str | Path | None = None,
    *,
    cubes: int | None = None,
    single: str | None = None,
    tank: Tank | None = None,
) -> dict[str, JumpPath]:
    """The run of each name: from a table of events or counts, and one of runs where no rows are marked start and end.

    A run's start is time 0 of its path. cubes, single, tank : as in `Given`
    ValueError: a table that is wrong, or a row that may be one of several channels; see `read_events` for such rows
    """
    reader, paths = _read(network, events, runs, cubes=cubes, single=single, tank=tank)
    for row, names in reader.causes.items():
        change = network.stoichiometry[network.channel_places[names[0]]]
        raise ValueError(
            f"{reader.events.where(row)}, time {reader.events.columns['time'][row]}: {reader.text(change, '+')} may be "
            f"{' or '.join(names)}; name the one that fired in the column channel, or estimate parameters of the "
            f"network by --free: where one of several channels fired, their rates add"
        )
    return paths


def read_events(
    network: Network,
    events: str | Path | Table,
    runs: str | Path | None = None,
    *,
    cubes: int | None = None,
    single: str | None = None,
    tank: Tank | None = None,
) -> EventData:
    """Runs of which every event is known, as `read_observed` reads them; rows may leave open which channel fired.

    A cell of `channel` may name several that change the same counts, between semicolons, and if it is empty, all that
    fit the change of the counts may have fired.
    """
    reader, paths = _read(network, events, runs, cubes=cubes, single=single, tank=tank)
    causes = {names: place for place, names in enumerate(dict.fromkeys(reader.causes.values()))}
    which = [
        np.array(
            [causes[reader.causes[row]] if row in reader.causes else -1 for row in reader.kept[run]], dtype=np.int64
        )
        for run in paths
    ]
    return EventData(list(paths.values()), list(causes), which)


def _read(
    network: Network, events: str | Path | Table, runs: str | Path | None, **known: Any
) -> tuple[_Reader, dict[str, JumpPath]]:
    """The reader of a table and the path of each run."""
    words = {*EVENT_COLUMNS, *NOTES, *RUN_COLUMNS} & set(network.species) | {START, END, RESTARTED} & set(
        network.channels
    )
    if words:
        raise ValueError(
            f"the network calls something {words.pop()!r}, which means something else in a table: rename it"
        )
    given = Given(network, **known)
    table = timed(read_table(events), network.time_unit)
    table.require("run", "time")
    given.check_titles(table, (*EVENT_COLUMNS, *NOTES))
    if not given.species(table):
        table.require("channel")
    windows = (
        windows_of_rows(given, table)
        if runs is None
        else windows_of_table(given, table, timed(read_table(runs), network.time_unit))
    )
    reader = _Reader(given, table)
    rows = reader.rows_by_run()
    for run in rows:
        if run not in windows:
            raise ValueError(
                f"{table.where(rows[run][0])}: the table of runs does not name this run; add when it started"
            )
    paths = {run: reader.path(run, window, rows.get(run, np.zeros(0, np.intp))) for run, window in windows.items()}
    return reader, paths


@dataclass(frozen=True, eq=False)
class _Reader:
    """Rows of events as paths of the network.

    causes : row -> channels one of which fired, where that is all that is known
    kept : run -> rows that are events
    """

    given: Given
    events: Table
    causes: dict[int, tuple[str, ...]] = field(default_factory=dict)
    kept: dict[str, list[int]] = field(default_factory=dict)

    @cached_property
    def network(self) -> Network:
        return self.given.network

    @cached_property
    def channels(self) -> Ints:
        """Channel of each row, RESTART or UNNAMED; rows of start and end are unnamed too."""
        words = {RESTARTED: RESTART, START: UNNAMED, END: UNNAMED, "": UNNAMED}
        found = []
        for row, cell in enumerate(self.events.columns.get("channel", [""] * len(self.events))):
            names = [name.strip() for name in cell.split(BETWEEN) if name.strip()] if cell not in words else [cell]
            where = self.events.where(row)
            fired = [words[n] if cell in words else self.given.channel(n, where, *words) for n in names]
            if len(fired) > 1:
                self.causes[row] = self.alike(row, fired)
            found.append(fired[0] if fired else UNNAMED)
        return np.array(found, dtype=np.int64)

    def alike(self, row: int, channels: Sequence[int]) -> tuple[str, ...]:
        """Names of channels one of which fired. ValueError: they change different counts"""
        names = tuple(self.network.channels[channel] for channel in sorted(set(channels)))
        changes = self.network.stoichiometry[list(channels)]
        if (changes != changes[0]).any():
            raise ValueError(f"{self.events.where(row)}: {' or '.join(names)} change different counts; name one")
        return names

    def rows_by_run(self) -> dict[str, Rows]:
        """Rows between start and end, run by run, in the order of the file."""
        found: dict[str, list[int]] = {}
        marks = self.events.columns.get("channel", [""] * len(self.events))
        for row, (run, mark) in enumerate(zip(self.events.columns["run"], marks, strict=True)):
            if not run:
                raise ValueError(f"{self.events.where(row)}: the run is not named")
            if mark not in (START, END):
                found.setdefault(run, []).append(row)
        return {run: np.array(rows, dtype=np.intp) for run, rows in found.items()}

    def path(self, run: str, window: ObservationWindow, rows: Rows) -> JumpPath:
        """The jump path of one run."""
        times = self.events.numbers("time", rows)
        self.check_order(window, rows, times)
        fired = self.channels[rows]
        titles = self.given.species(self.events)
        stated = self.events.counts(titles, rows)
        if titles and not np.isnan(stated).all():
            fired = self.inferred(window, rows, stated)
        elif (fired == UNNAMED).any():
            raise ValueError(f"{self.events.where(rows[(fired == UNNAMED).argmax()])}: neither a channel nor counts")
        is_change = fired != UNNAMED
        self.kept[run] = rows[is_change].tolist()
        try:
            path = JumpPath(
                self.network,
                window.initial,
                times[is_change] - window.start,
                fired[is_change],
                window.end - window.start,
                window.is_open,
                window.tank,
                self.partners(rows[is_change], fired[is_change]),
                window.resolution,
            )
        except ValueError as error:
            raise ValueError(
                f"{self.events.name}, run {run}, times from its start: {error}; check the rows before, and its start"
            ) from error
        final, counts = window.final or {}, path.at([path.end])[0]
        if not np.array_equal(counts[[self.network.index(name) for name in final]], list(final.values())):
            said, left = self.text(self.network.state(final)), self.text(counts)
            raise ValueError(f"{self.events.name}, run {run}: it ends with {said}, but its rows leave {left}")
        return path

    def partners(self, rows: Rows, fired: Ints) -> Ints | None:
        """Who broke what (len(rows),), as in `JumpPath.partners`; None if there is no such column."""
        if "partner" not in self.events.columns:
            return None
        breaks = is_break(self.network)
        known = {name: s for s, name in enumerate(self.network.species)} | {"wall": BY_WALL, "several": BY_SEVERAL}
        found = []
        for row, channel in zip(rows.tolist(), fired.tolist(), strict=True):
            name = self.events.columns["partner"][row]
            can_have = channel >= 0 and bool(breaks[channel])
            if name and not can_have:
                raise ValueError(f"{self.events.where(row)}: {name} as a partner of what is no break; leave it empty")
            if name and name not in known:
                raise ValueError(
                    f"{self.events.where(row)}: unknown partner {name!r}; expected a species, wall, or several"
                )
            found.append(known.get(name, BY_UNKNOWN) if can_have else NO_BREAK)
        return np.array(found, dtype=np.int64)

    def check_order(self, window: ObservationWindow, rows: Rows, times: Floats) -> None:
        """Times rise from start to end; equal ones only at a restart, or within the resolution."""
        before = np.concatenate([[window.start], times])[:-1]
        for is_wrong, said in (
            (times < window.start, f"this run has not started yet; it starts at {window.start:g}"),
            (times > window.end, f"this run is over; it ends at {window.end:g}"),
            (times < before, "this comes after a row with a later time; sort the rows of a run by time"),
            (
                (times == before) & (self.channels[rows] != RESTART) & (window.resolution == 0),
                "a second row at this time; if the clock is so coarse, say it in a table of runs, column resolution",
            ),
        ):
            if is_wrong.any():
                row = int(is_wrong.argmax())
                raise ValueError(f"{self.events.where(rows[row])}, time {times[row]:g}: {said}")

    @cached_property
    def counted(self) -> list[int]:
        """The species that have a column; of the others the table says nothing after a start."""
        return [self.network.index(name) for name in self.given.species(self.events)]

    def inferred(self, window: ObservationWindow, rows: Rows, stated: Floats) -> Ints:
        """Channels (len(rows),) where counts are stated; UNNAMED in a row that changes nothing."""
        fired, state = self.channels[rows], window.initial
        for place, row in enumerate(rows.tolist()):
            empty = np.isnan(stated[place])
            if empty.any() and not empty.all():
                name = self.network.species[self.counted[int(empty.argmax())]]
                raise ValueError(f"{self.events.where(row)}: the cell of {name} is empty; write 0 if there are none")
            after = None
            if not empty.any():
                after = state.copy()
                after[self.counted] = stated[place]
            if fired[place] == UNNAMED:
                if after is None:
                    raise ValueError(f"{self.events.where(row)}: neither a channel nor counts")
                fired[place] = self.channel_of(row, after - state, state)
            expected = self.after(state, int(fired[place]), window.initial)
            if after is not None and not np.array_equal(after[self.counted], expected[self.counted]):
                raise ValueError(
                    f"{self.events.where(row)}: {self.events.columns['channel'][row]} leaves {self.text(expected)}, "
                    f"but the counts say {self.text(after)}"
                )
            state = expected
        return fired

    def after(self, state: Ints, channel: int, initial: Ints) -> Ints:
        """Counts (S,) after a row."""
        if channel == UNNAMED:
            return state
        if channel == RESTART:
            return initial
        following = state.copy()
        species, gains = self.network.sparse_stoichiometry.row(channel)
        following[species] += gains
        return following

    def channel_of(self, row: int, change: Ints, before: Ints) -> int:
        """The one channel that makes a change (S,) of the species that are counted; UNNAMED where nothing changed."""
        places = np.flatnonzero(change)
        fitting = self.by_change.get(tuple(zip(places.tolist(), change[places].tolist(), strict=True)), [])
        if not places.size:
            if not fitting:
                return UNNAMED
            hidden = " or ".join(self.network.channels[channel] for channel in fitting)
            raise ValueError(
                f"{self.events.where(row)}: no count changes; that may be {hidden}, or no event: give every species "
                "that they change a column, or name what fired in the column channel"
            )
        if fitting and (self.network.stoichiometry[fitting] == self.network.stoichiometry[fitting[0]]).all():
            if len(fitting) > 1:
                self.causes[row] = self.alike(row, fitting)
            return fitting[0]
        said = f"{self.events.where(row)}, time {self.events.columns['time'][row]}: {self.text(change, '+')}"
        if fitting:
            names = " or ".join(self.network.channels[channel] for channel in fitting)
            raise ValueError(f"{said} may be {names}; name the one that fired in the column channel")
        whole = len(self.counted) == len(self.network.species)
        for name, amount in self.network.conserved.items() if whole else ():
            if gained := float(amount @ change):
                held = float(amount @ before)
                raise ValueError(
                    f"{said}; {name} go from {held:g} to {held + gained:g}, but no channel changes their number"
                )
        changes = self.network.stoichiometry
        nearest = np.argsort(np.abs(changes - change).sum(axis=1), kind="stable")[:NEAREST].tolist()
        known = "; ".join(f"{self.network.channels[j]} ({self.text(changes[j], '+')})" for j in nearest)
        raise ValueError(f"{said}: no channel does that; nearest are {known}. Where two fired, give each a row")

    @cached_property
    def by_change(self) -> dict[Change, list[int]]:
        """A dictionary from each change of counted species to its channels; channels without effect are left out."""
        found: dict[Change, list[int]] = {}
        for channel in range(len(self.network.channels)):
            species, gains = self.network.sparse_stoichiometry.row(channel)
            seen = {s: gain for s, gain in zip(species.tolist(), gains.tolist(), strict=True) if s in self.counted}
            if species.size:
                found.setdefault(tuple(sorted(seen.items())), []).append(channel)
        return found

    def text(self, counts: Ints, sign: str = "") -> str:
        """Counts or changes as text."""
        return ", ".join(f"{self.network.species[s]} {counts[s]:{sign}d}" for s in np.flatnonzero(counts)) or "nothing"
