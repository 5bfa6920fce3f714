"""Tables from outside, CSV or Parquet: columns of text with the rows they stand in, and numbers with words for errors.

Cells are kept as text until a number is asked for, so that both kinds of file are read alike and a float written in
full comes back to the last digit.
"""

from __future__ import annotations

import csv
import difflib
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.support.arrays import Floats
from kinetics.support.limits import BREAKS, check_visible, text_in

SUFFIXES = (".csv", ".parquet")
MOST_CELLS = 10_000_000  # of a Parquet file, in which any number of equal cells takes no room
# What pyarrow and pandas raise on damaged files, whose checksums may be right.
DAMAGES = (ValueError, TypeError, LookupError, AttributeError, RuntimeError, OSError, OverflowError, csv.Error)
INDEX = re.compile(r"__index_level_\d+__")  # the rows of a data frame, numbered
LARGEST = 2.0**53  # of a count; beyond it a float skips whole numbers


@dataclass(frozen=True, eq=False)
class Table:
    """A table of text, with the place of each row in its file.

    name : of the file
    columns : title -> cells (n,), stripped; an empty cell, nothing or NaN, is ""
    lines : (n,) where each row stands in the file, the titles being line 1
    """

    name: str
    columns: dict[str, NDArray[Any]]
    lines: NDArray[np.int64]

    def __len__(self) -> int:
        return self.lines.size

    def require(self, *titles: str) -> None:
        """ValueError if a column is missing."""
        missing = [title for title in titles if title not in self.columns]
        if missing:
            raise ValueError(
                f"{self.name} has no column {', '.join(missing)}; it has {', '.join(self.columns)}: give it a first "
                "line of titles, separated by commas"
            )

    def where(self, row: int) -> str:
        """The place of a row as text: file, line and run."""
        run = self.columns["run"][row] if "run" in self.columns else ""
        return f"{self.name}, line {self.lines[row]}" + (f", run {run}" if run else "")

    def rows(self, chosen: NDArray[np.intp]) -> Table:
        """The table with these rows only."""
        return Table(self.name, {title: cells[chosen] for title, cells in self.columns.items()}, self.lines[chosen])

    def without(self, title: str) -> Table:
        """The table without a column."""
        return Table(self.name, {name: cells for name, cells in self.columns.items() if name != title}, self.lines)

    def numbers(self, title: str, rows: NDArray[np.intp], may_be_empty: bool = False) -> Floats:
        """Finite numbers (len(rows),) of a column; an empty cell is nan if that is allowed, else an error."""
        cells = self.columns[title][rows]
        empty = cells == ""
        if empty.any() and not may_be_empty:
            raise ValueError(f"{self.where(rows[empty.argmax()])}: {title} is empty; expected a number")
        try:
            found = np.where(empty, "nan", cells).astype(float)
        except ValueError:
            found = np.array([_number(cell) for cell in cells])
        bad = ~np.isfinite(found) & ~empty
        if bad.any():
            first = int(bad.argmax())
            raise ValueError(f"{self.where(rows[first])}: {title} = {cells[first]}; expected a finite number")
        return found

    def counts(self, titles: Sequence[str], rows: NDArray[np.intp]) -> Floats:
        """Whole numbers (len(rows), len(titles)) of at least 0; nan if a cell is empty."""
        found = np.empty((rows.size, len(titles)))
        for column, title in enumerate(titles):
            found[:, column] = self.numbers(title, rows, may_be_empty=True)
        wrong = (found < 0) | (found != np.rint(found)) & ~np.isnan(found) | (found > LARGEST)
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            raise ValueError(
                f"{self.where(rows[row])}: {self.columns[titles[column]][rows[row]]} copies of {titles[column]}; "
                "expected a whole number, 0 or more"
            )
        return found


def read_table(path: str | Path | Table | Any) -> Table:
    """Read a CSV or Parquet file, or a data frame of pandas; a table is returned as it is.

    ValueError: neither of them, empty, damaged, or of too many cells
    """
    if isinstance(path, Table):
        return path
    if hasattr(path, "itertuples"):
        return _frame(path)
    file = Path(path)
    if file.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path}: expected a table whose name ends in {' or '.join(SUFFIXES)}")
    if not file.is_file():
        fault = "is no file; a table is read more than once" if file.exists() else "does not exist"
        raise ValueError(f"table {path} {fault}")
    try:
        titles, cells, lines = _csv(file) if file.suffix.lower() == ".csv" else _parquet(file)
    except DAMAGES as error:
        raise ValueError(f"{path} cannot be read as a table: {' '.join(str(error).split())}") from error
    if len(set(titles)) < len(titles):
        raise ValueError(f"{path} has two columns of one title; its titles are {', '.join(titles)}")
    for title, column in zip(titles, cells, strict=True):
        for text in (title, *column):
            if not text.isprintable():
                check_visible(f"{path}: column {title!r} has a text", BREAKS.sub(" ", text))
    if not lines.size:
        raise ValueError(f"{path} is empty: it has no rows below its titles")
    return Table(file.name, dict(zip(titles, cells, strict=True)), lines)


def _frame(frame: Any) -> Table:
    """A data frame as a table of text; its first row counts as line 2, as below a line of titles."""
    if not len(frame):
        raise ValueError("the data frame is empty: it has no rows")
    columns = {}
    for title in frame.columns:
        cells = zip(frame[title].tolist(), frame[title].isna().tolist(), strict=True)
        columns[str(title).strip()] = np.array(
            ["" if is_empty else str(x).strip() for x, is_empty in cells], dtype=object
        )
    return Table("the data frame", columns, np.arange(len(frame), dtype=np.int64) + 2)


def _csv(file: Path) -> tuple[list[str], list[NDArray[Any]], NDArray[np.int64]]:
    """Titles, columns and line numbers; a row that is cut short has empty cells, and empty rows are passed over."""
    titles: list[str] = []
    rows, lines = [], []
    reader = csv.reader(io.StringIO(text_in(file), newline=""), skipinitialspace=True)
    for row in reader:
        cells = [cell.strip() for cell in row]
        if not any(cells):
            continue
        if not titles:
            titles = cells
            continue
        if len(cells) > len(titles):
            raise ValueError(
                f"line {reader.line_num} has {len(cells)} cells for {len(titles)} titles; put a name that holds a "
                "comma in double quotes"
            )
        rows.append(cells + [""] * (len(titles) - len(cells)))
        lines.append(reader.line_num)
    columns = np.array(rows, dtype=object).reshape(len(rows), len(titles)).T
    return titles, list(columns), np.array(lines, dtype=np.int64)


def _parquet(file: Path) -> tuple[list[str], list[NDArray[Any]], NDArray[np.int64]]:
    """Read a Parquet file as a table of text; rows are numbered as if they stood below a line of titles."""
    from pyarrow import parquet

    opened = parquet.ParquetFile(file)
    told, titles = opened.metadata, opened.schema_arrow.names
    if told.num_rows * max(1, len(titles)) > MOST_CELLS:
        raise ValueError(f"{told.num_rows} rows of {len(titles)} columns; at most {MOST_CELLS} cells are read")
    if len(set(titles)) < len(titles):
        raise ValueError(f"two columns of one title; its titles are {', '.join(titles)}")
    kept = [title for title in titles if not INDEX.fullmatch(title)]
    columns = [_texts(opened.read(columns=[title], use_threads=False).column(0)) for title in kept]
    return [title.strip() for title in kept], columns, np.arange(told.num_rows, dtype=np.int64) + 2


def _texts(column: Any) -> NDArray[Any]:
    """The cells of a column of Arrow as text, each text kept once however often it stands there."""
    coded = column.combine_chunks()
    if not hasattr(coded, "dictionary"):
        coded = coded.dictionary_encode()
    values = coded.dictionary.to_pylist()
    texts = ["" if value is None or str(value) == "nan" else str(value).strip() for value in values]
    return np.asarray(np.array([*texts, ""], dtype=object)[coded.indices.fill_null(len(texts)).to_numpy()])


def near(name: str, known: Sequence[str], shown: int = 8) -> str:
    """`; did you mean …?`, or else what is known."""
    close = difflib.get_close_matches(name, known, n=3, cutoff=0.6)
    if close:
        return f"; did you mean {' or '.join(close)}?"
    more = f" and {len(known) - shown} more" if len(known) > shown else ""
    return f"; expected one of {', '.join(known[:shown])}{more}"


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")
