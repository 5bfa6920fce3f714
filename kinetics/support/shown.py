"""Results that show themselves: a line as `repr`, a table as text or HTML, and figures on axes of their own."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.support.output import write_whole
from kinetics.support.packages import extra, pd, plt
from kinetics.support.tables import of_unit, text_table, with_spread

MOST_TIMES = 11  # rows of a table for people
RUN_SPREAD = "mean ± sd of a run"  # what the figures of predicted counts are

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ResultTable:
    """Headline, titles and rows of text, and one line for each note."""

    headline: str
    titles: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()

    @property
    def text(self) -> str:
        """Aligned columns for a terminal."""
        return "\n".join([self.headline, text_table(self.titles, self.rows), *self.notes])

    @property
    def html(self) -> str:
        """A table for a notebook; names are escaped."""
        lines = ["".join(f"<th>{html.escape(title)}</th>" for title in self.titles)]
        lines += ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in self.rows]
        table = "".join(f"<tr>{line}</tr>" for line in lines)
        notes = "".join(f"<p>{html.escape(note)}</p>" for note in self.notes)
        return f"<p>{html.escape(self.headline)}</p><table>{table}</table>{notes}"


class Shown(ABC):
    """Base of results: `repr` is their headline, `str` and the display of a notebook their table."""

    @property
    @abstractmethod
    def headline(self) -> str:
        """What it is, in a line that costs nothing to make."""

    @abstractmethod
    def summary(self) -> ResultTable:
        """Headline, figures and notes as one table."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.headline}>"

    def __str__(self) -> str:
        return self.summary().text

    def _repr_html_(self) -> str:
        return self.summary().html


class Tabular(ABC):
    """Base of results with one tidy table."""

    @abstractmethod
    def to_dataframe(self) -> pd.DataFrame:
        """The table, for pandas."""

    def to_parquet(self, path: str | Path) -> Path:
        """Write the table to a Parquet file, whole or not at all; returns its path."""
        extra("pyarrow")
        return write_whole(path, self.to_dataframe().to_parquet(index=False))


def facts(headline: str, values: Mapping[str, str], notes: Sequence[str] = ()) -> ResultTable:
    """A table with a row for each of a few figures, name -> value."""
    return ResultTable(headline, ("", "value"), list(values.items()), notes)


def over_time(
    headline: str,
    times: Floats,
    unit: str,
    names: Sequence[str],
    cell: Callable[[int, int], str],
    notes: Sequence[str] = (),
) -> ResultTable:
    """A table with a row for each of at most `MOST_TIMES` of the times, `cell(t, s)` in its columns."""
    step = max(1, -(-(times.size - 1) // (MOST_TIMES - 1))) if times.size > MOST_TIMES else 1
    rows = [[f"{times[t]:g}", *(cell(t, s) for s in range(len(names)))] for t in range(0, times.size, step)]
    return ResultTable(headline, (of_unit("time", unit), *names), rows, notes)


def means_over_time(
    headline: str, times: Floats, unit: str, names: Sequence[str], mean: Floats, sd: Floats, note: str
) -> ResultTable:
    """A table over time with means and standard deviations (T, S) in its columns."""
    return over_time(headline, times, unit, names, lambda t, s: with_spread(mean[t, s], sd[t, s]), [note])


def precision_of(standard_error: Floats) -> str:
    """How well the means of runs are known, from their standard errors (T, S): nan for a single run."""
    largest = standard_error.max(initial=0.0)
    return "a single run has no spread" if np.isnan(largest) else f"largest standard error of a mean {largest:.2g}"


def on_axes(draw: Callable[..., Any]) -> Callable[..., Any]:
    """A method `plot(ax, ...)` that may be called without `ax`: it then draws onto a new figure.

    >>> class Line:
    ...     @on_axes
    ...     def plot(self, ax):
    ...         ax.plot([0, 1], [0, 1])
    ...         return ax
    >>> Line().plot().get_title()
    ''
    """

    @wraps(draw)
    def plot(self: Any, ax: Any = None, *settings: Any, **named: Any) -> Any:
        if ax is None:
            _, ax = plt.subplots(layout="constrained")
        return draw(self, ax, *settings, **named)

    return plot
