"""`Scan`: the answers at the points of a grid, as one tidy table, arrays with a dimension a name, and pictures."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.predicting.scanning.answer import (
    COUNTS,
    ESTIMATED,
    NUMBERS,
    PROVEN,
    SAMPLED,
    UNANSWERED,
    WORDS,
    ScanAnswer,
)
from kinetics.support.arrays import Floats
from kinetics.support.datasets import dataset
from kinetics.support.extras import extra
from kinetics.support.shown import ResultTable, Shown, Tabular
from kinetics.support.tables import counted, figure, of_unit

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

MOST_ROWS = 40  # of a table for people
MOST_WHYS = 5
RESERVED = {"question", *NUMBERS, *COUNTS, *WORDS}  # columns, which no scanned name may have


@dataclass(frozen=True, eq=False, repr=False)
class Scan(Shown, Tabular):
    """The answers to Q questions at the P points of a grid.

    over : name -> its values; the grid has every combination, the last name going fastest
    answers : (P,) of the points, each with Q answers, or None where Ctrl-C came before it was made
    labels : name -> title of its axis
    time_unit : of all times in the questions, "" where none is stated

    >>> from kinetics import Network, scan
    >>> found = scan(Network.from_text("A -> B, k", k=1), {"k": [1, 2], "A": [3, 4]}, ["E[A] @ 1"])
    >>> found.shape, found.numbers("value")[:, :, 0].round(4).tolist()
    ((2, 2), [[1.1036, 1.4715], [0.406, 0.5413]])
    """

    over: Mapping[str, Floats]
    questions: tuple[str, ...]
    answers: tuple[tuple[ScanAnswer, ...] | None, ...]
    labels: Mapping[str, str]
    time_unit: str = ""

    @property
    def titles(self) -> tuple[str, ...]:
        """The questions, with the unit of their times."""
        return tuple(of_unit(question, self.time_unit and f"t in {self.time_unit}") for question in self.questions)

    @property
    def points(self) -> Iterator[dict[str, float]]:
        """Name -> value at every point, in the order of the answers."""
        return grid_points(self.over)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each name."""
        return tuple(len(values) for values in self.over.values())

    @property
    def is_complete(self) -> bool:
        """Whether every point has its answers."""
        return None not in self.answers

    @property
    def unanswered(self) -> int:
        """Number of answers that a question does not have at a point."""
        return sum(each.answered == UNANSWERED for answers in self.answers for each in answers or ())

    @property
    def cpu_seconds(self) -> float:
        """Processor time of all answers, those that were kept from before included."""
        return float(np.nansum(self.numbers("cpu_seconds")))

    def numbers(self, what: str) -> Floats:
        """One of `NUMBERS` or `COUNTS` at all points, (n1, n2, ..., Q); nan where it was not made."""
        if what not in NUMBERS + COUNTS:
            raise ValueError(f"{what!r}; expected one of {', '.join(NUMBERS + COUNTS)}")
        none = [None] * len(self.questions)
        table = [[getattr(each, what, None) for each in answers or none] for answers in self.answers]
        return np.array(table, dtype=float).reshape(*self.shape, len(self.questions))

    def words(self, what: str) -> Any:
        """One of `WORDS` at all points, (n1, n2, ..., Q) of text; "" where not made."""
        none = [None] * len(self.questions)
        table = [[getattr(each, what, "") for each in answers or none] for answers in self.answers]
        return np.array(table, dtype=object).reshape(*self.shape, len(self.questions))

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row a point and question that was answered: the point, the question, and its answer."""
        return [
            {**point, "question": question, **asdict(answer)}
            for point, answers in zip(self.points, self.answers, strict=True)
            for question, answer in zip(self.questions, answers or (), strict=False)
        ]

    @property
    def headline(self) -> str:
        """Its size, how it was answered, and the cost."""
        done = [each for answers in self.answers if answers for each in answers]
        points = sum(answers is not None for answers in self.answers)
        of_all = "" if self.is_complete else f" of {len(self.answers)}"
        kinds = [f"{sum(each.answered == kind for each in done)} {kind}" for kind in (PROVEN, ESTIMATED, SAMPLED)]
        kinds.append(f"{self.unanswered} without an answer")
        told = ", ".join(kind for kind in kinds if not kind.startswith("0 "))
        grid = " x ".join(f"{name} ({len(values)})" for name, values in self.over.items())
        asked = counted(len(self.questions), "question")
        of_points = counted(len(self.answers), "point").split()[1]
        return f"{points}{of_all} {of_points} of {grid}, {asked}: {told}; {self.cpu_seconds:.2g} s CPU"

    def summary(self) -> ResultTable:
        """The rows, at most `MOST_ROWS` of them, and what their limits mean."""
        rows = [
            [
                *(f"{row[name]:.6g}" for name in self.over),
                row["question"],
                *_shown(row),
                f"{row['cpu_seconds']:.2g}",
            ]
            for row in self.rows
        ]
        notes = [f"times in {self.time_unit}"] if self.time_unit else []
        notes += ["limits: proven or estimated of what is exact, 95 % intervals of what is sampled"]
        whys = dict.fromkeys(each.why for answers in self.answers for each in answers or () if each.why)
        notes += [f"none: {why}" for why in list(whys)[:MOST_WHYS]]
        if len(whys) > MOST_WHYS:
            notes.append(f"none: {len(whys) - MOST_WHYS} more reasons, in the column why")
        if len(rows) > MOST_ROWS:
            notes.append(f"{len(rows) - MOST_ROWS} more rows; they are in the files, in JSON and in to_dataframe()")
        titles = [*self.over, "question", "value", "limits", "answered", "by", "s CPU"]
        return ResultTable(self.headline, titles, rows[:MOST_ROWS], notes)

    def to_dataframe(self) -> pd.DataFrame:
        """One row a point and question that was answered."""
        pandas = extra("pandas")
        frame = pandas.DataFrame(self.rows, columns=[*self.over, "question", *_fields()])
        return frame.astype(dict.fromkeys(COUNTS, "Int64"))

    def to_xarray(self) -> xr.Dataset:
        """A Dataset with a dimension for each scanned name and one for the question; nan where not made."""
        dims = (*self.over, "question")
        content = {what: (dims, self.numbers(what)) for what in NUMBERS + COUNTS}
        content |= {what: (dims, self.words(what).astype(str)) for what in WORDS}
        found = dataset(content, {**self.over, "question": list(self.questions)})
        found.attrs["time_unit"] = self.time_unit
        for name, label in self.labels.items():
            found[name].attrs["long_name"] = label
        return found

    def plot(self, figure: Any = None) -> Any:
        """Draw every question: lines with limits over one name, a heat map over two, one for each value of more.

        figure : Matplotlib's, to be drawn into; a new one where none is given. Returns it.
        """
        from kinetics.predicting.scanning.pictures import draw_scan, size_of

        if figure is None:
            extra("matplotlib")
            import matplotlib.pyplot as plt

            figure = plt.figure(figsize=size_of(self), layout="constrained")
        draw_scan(figure, self)
        return figure


def grid_points(over: Mapping[str, Floats]) -> Iterator[dict[str, float]]:
    """Every combination of the values, the last name going fastest."""
    for values in itertools.product(*(column.tolist() for column in over.values())):
        yield dict(zip(over, values, strict=True))


def _shown(row: Mapping[str, Any]) -> tuple[str, str, str, str]:
    """Value, limits, how it was answered, and by what."""
    n, what = (row["states"], "state") if row["states"] else (row["runs"], "run")
    by = "" if n is None else counted(n, what)
    if row["why"]:
        return "", "", UNANSWERED, by
    limits = "all runs alike" if np.isnan(row["low"]) else _limits(row["value"], row["low"], row["high"])
    return f"{row['value']:.6g}", limits, f"{row['answered']}, {row['method']}", by


def _limits(value: float, low: float, high: float) -> str:
    """Limits as an interval, or as what they add where they agree in all digits that are shown."""
    wide = max(high - value, value - low)
    return f"± {wide:.1g}" if wide <= 1e-5 * abs(value) else f"[{figure(low, '.6g')}, {figure(high, '.6g')}]"


def _fields() -> list[str]:
    return list(ScanAnswer.__dataclass_fields__)
