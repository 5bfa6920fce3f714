"""Times in a unit that the title of their column states: `time (min)` or `time [min]`."""

from __future__ import annotations

import re

import numpy as np

from calibration.observed.tables import Table

TITLE = re.compile(r"(time|start|end)\s*[(\[]\s*([^)\]]+?)\s*[)\]]")
DAY = 86400.0
SECONDS = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("min", "minute", "minutes"), 60.0),
    **dict.fromkeys(("h", "hour", "hours"), 3600.0),
    **dict.fromkeys(("d", "day", "days"), DAY),
    **dict.fromkeys(("week", "weeks"), 7.0 * DAY),
    **dict.fromkeys(("month", "months"), 365.25 / 12.0 * DAY),
    **dict.fromkeys(("a", "year", "years"), 365.25 * DAY),
}


def timed(table: Table, unit: str) -> Table:
    """The table with its times in the unit of a network, and plain titles for them.

    unit : of the network; "" if it states none, so that times are taken as they are
    ValueError: a unit that cannot be converted; a month is a twelfth of 365.25 days

    >>> import numpy as np
    >>> from calibration.observed.tables import Table
    >>> from calibration.observed.time_units import timed
    >>> table = Table("a.csv", {"time (min)": np.array(["0", "90"])}, np.array([2, 3]))
    >>> timed(table, "h").columns["time"].tolist()
    ['0.0', '1.5']
    """
    columns = {}
    for title, cells in table.columns.items():
        match = TITLE.fullmatch(title)
        if match is None:
            columns[title] = cells
            continue
        name, stated = match.groups()
        if name in table.columns or name in columns:
            raise ValueError(f"{table.name} has two columns of {name}: {name!r} and {title!r}; leave one out")
        columns[name] = cells if not unit or stated == unit else _converted(table, title, stated, unit)
    return Table(table.name, columns, table.lines)


def _converted(table: Table, title: str, stated: str, unit: str) -> np.ndarray:
    if stated not in SECONDS or unit not in SECONDS:
        unknown = stated if stated not in SECONDS else unit
        raise ValueError(
            f"{table.name}: times in {stated}, but the network's unit of time is {unit}, and {unknown} is no unit that "
            f"is known here; give times in {unit}"
        )
    factor = SECONDS[stated] / SECONDS[unit]
    numbers = table.numbers(title, np.arange(len(table)), may_be_empty=True)
    return np.array(["" if np.isnan(x) else repr(float(x * factor)) for x in numbers], dtype=object)
