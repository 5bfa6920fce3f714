"""Jump paths as two tables that any program can read and write: one of events, one of runs.

    events   run, time, channel            a row an event; the channel `restart` puts the run back to its start
    runs     run, start, end, tank, resolution, closed, and a column for each species: its copies at the start

Times are in tu, of a clock of the run's own. `tank` is the tank's three lengths, `closed` the channels that could not
fire at all, `resolution` the time between two looks, within which events share a time; each may be left out. `NOTES`
are further columns of the events, for other readers. docs/observed_events.md describes what a reader takes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.packages import pd

EVENT_COLUMNS = ("run", "time", "channel")
NOTES = ("cube_a", "cube_b", "partner")  # of an event, if they are known: whose bond it was, and who broke it
RUN_COLUMNS = ("run", "start", "end", "tank", "resolution", "closed")
START, END, RESTARTED = "start", "end", "restart"  # in place of a channel
BETWEEN = ";"  # between the channels of `closed`


class TableRun(NamedTuple):
    """One run as the tables hold it; the arrays are those of a `JumpPath`.

    tank : lengths of the tank, or None
    resolution : tu between two looks; 0 if every event has a time of its own
    notes : further columns of the events, of `NOTES`
    """

    name: str
    species: Sequence[str]
    channels: Sequence[str]
    initial: ArrayLike
    times: ArrayLike
    fired: ArrayLike
    end: float
    open_channels: ArrayLike
    tank: Sequence[float] | None = None
    resolution: float = 0.0
    notes: Mapping[str, Any] = MappingProxyType({})


def event_tables(runs: Iterable[TableRun]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables of the events and of the runs. ValueError: the runs are of two networks, which no one table can hold."""
    events = [pd.DataFrame({"run": pd.Series(dtype="str"), "time": pd.Series(dtype="float64"), "channel": ""})]
    rows = []
    names: tuple[Sequence[str], Sequence[str]] | None = None
    for run in runs:
        names = names or (run.species, run.channels)
        if names != (run.species, run.channels):
            raise ValueError(
                f"runs of two networks, with channels {', '.join(names[1][:4])}, … and {', '.join(run.channels[:4])}, "
                "…; a table holds runs of one network: choose those of one rule book"
            )
        happened = np.array([*run.channels, RESTARTED], dtype=object)[np.asarray(run.fired, dtype=int)]  # RESTART = -1
        events.append(pd.DataFrame({"run": run.name, "time": run.times, "channel": happened} | dict(run.notes)))
        closed = [
            name for name, is_open in zip(run.channels, np.asarray(run.open_channels), strict=True) if not is_open
        ]
        tank = "" if run.tank is None else " ".join(repr(float(length)) for length in run.tank)
        facts = (run.name, 0.0, float(run.end), tank, float(run.resolution), f"{BETWEEN} ".join(closed))
        rows.append(
            dict(zip(RUN_COLUMNS, facts, strict=True)) | dict(zip(run.species, np.asarray(run.initial), strict=True))
        )
    return pd.concat(events[1:] or events, ignore_index=True), pd.DataFrame(rows, columns=None if rows else RUN_COLUMNS)
