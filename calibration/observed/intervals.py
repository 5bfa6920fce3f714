"""Cells of a table of counts that say an interval: `3..5`, `>=10`, `<=2`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

import numpy as np

from calibration.observed.tables import Table
from kinetics.markov.panels.observations import Censored, Exact, Observation

APART = 1e-6  # between numbers that stand for different intervals with one middle


def with_intervals(
    table: Table, titles: Sequence[str], observations: Mapping[str, Observation]
) -> tuple[Table, dict[str, Observation]]:
    """The table with a number, of those in it, for each interval, and with the observations that say which.

    ValueError: an interval that holds no count, or in a column whose counts are not exact

    >>> import numpy as np
    >>> from calibration.observed.intervals import with_intervals
    >>> from calibration.observed.tables import Table
    >>> table = Table("t.csv", {"A": np.array(["3..6", "4", ">=9"], dtype=object)}, np.arange(2, 5))
    >>> changed, how = with_intervals(table, ["A"], {})
    >>> changed.columns["A"].tolist(), how["A"].intervals
    (['4.5', '4', '9.000001'], {4.5: (3.0, 6.0), 9.000001: (9.0, inf)})
    """
    columns, how = dict(table.columns), dict(observations)
    for title in titles:
        cells = table.columns[title]
        said = {cell: found for cell in dict.fromkeys(cells.tolist()) if (found := _interval(cell)) is not None}
        if not said:
            continue
        for cell, (low, high) in said.items():
            where = f"{table.where(int((cells == cell).argmax()))}: {title} = {cell}"
            if not isinstance(how.get(title, Exact()), Exact):
                raise ValueError(f"{where}; an interval of true counts, in a column that is {how[title].name}")
            if not 0.0 <= low <= high or low != int(low) or (high < inf and high != int(high)):
                raise ValueError(f"{where}; expected whole numbers of at least 0 that rise, as in 3..5")
        intervals: dict[float, tuple[float, float]] = {}
        texts = {cell: repr(low) for cell, (low, high) in said.items() if low == high}
        for cell, (low, high) in said.items():
            if low < high:
                number = (low + high) / 2.0 if high < inf else low
                while number == int(number) or number in intervals:
                    number = round(number + APART, 6)
                intervals[number], texts[cell] = (low, high), repr(number)
        columns[title] = np.array([texts.get(cell, cell) for cell in cells.tolist()], dtype=object)
        how[title] = Censored(intervals)
    return Table(table.name, columns, table.lines), how


def _interval(cell: str) -> tuple[float, float] | None:
    """The ends that a cell states; None if it states none."""
    try:
        if cell.startswith(">="):
            return float(cell[2:]), inf
        if cell.startswith("<="):
            return 0.0, float(cell[2:])
        low, dots, high = cell.partition("..")
        return (float(low), float(high)) if dots else None
    except ValueError:
        return None
