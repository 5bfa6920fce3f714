"""`Scan`: the answers at the points of a grid, as one tidy table, arrays with a dimension a name, and pictures."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.markov.questions import parse
from kinetics.predicting.scanning.page import scan_page
from kinetics.predicting.scanning.pictures import draw_scan, size_of
from kinetics.support.answer import CONFIDENCE, ESTIMATE, NONE, PROVEN, Answer
from kinetics.support.arrays import Floats
from kinetics.support.datasets import dataframe, dataset
from kinetics.support.output import write_whole
from kinetics.support.packages import pd, plt
from kinetics.support.shown import ResultTable, Shown, Tabular
from kinetics.support.tables import counted

if TYPE_CHECKING:
    import xarray as xr

MOST_ROWS = 40  # of a table for people
MOST_WHYS = 5
NUMBERS = ("value", "low", "high", "cpu_seconds")
WORDS = ("kind", "method", "why")
RESERVED = {"question", *NUMBERS, *WORDS}  # columns, which no scanned name may have
IN_WORDS = {PROVEN: "proven", ESTIMATE: "estimated", CONFIDENCE: "sampled", NONE: "without an answer"}


@dataclass(frozen=True, eq=False, repr=False)
class Scan(Shown, Tabular):
    """The answers to Q questions at the P points of a grid.

    over : name -> its values; the grid has every combination, the last name going fastest
    answers : (P,) of the points, each with Q answers, or None if Ctrl-C came before it was made
    labels : name -> title of its axis
    time_unit : of all times in the questions, "" if none is stated

    >>> from kinetics import Network, scan
    >>> found = scan(Network.from_text("A -> B, k", k=1), {"k": [1, 2], "A": [3, 4]}, ["E[A] @ 1"])
    >>> found.shape, found.numbers("value")[:, :, 0].round(4).tolist()
    ((2, 2), [[1.1036, 1.4715], [0.406, 0.5413]])
    """

    over: Mapping[str, Floats]
    questions: tuple[str, ...]
    answers: tuple[tuple[Answer, ...] | None, ...]
    labels: Mapping[str, str]
    time_unit: str = ""

    @property
    def titles(self) -> tuple[str, ...]:
        """What each question asks for, in words with its unit: titles of axes."""
        return tuple(parse(question).title(question, self.time_unit) for question in self.questions)

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
        return sum(each.kind == NONE for answers in self.answers for each in answers or ())

    @property
    def cpu_seconds(self) -> float:
        """Processor time of all answers, those that were kept from before included."""
        return float(np.nansum(self.numbers("cpu_seconds")))

    def numbers(self, what: str) -> Floats:
        """One of `NUMBERS` at all points, (n1, n2, ..., Q); nan if it was not made."""
        if what not in NUMBERS:
            raise ValueError(f"{what!r}; expected one of {', '.join(NUMBERS)}")
        none = [None] * len(self.questions)
        table = [[getattr(each, what, None) for each in answers or none] for answers in self.answers]
        return np.array(table, dtype=float).reshape(*self.shape, len(self.questions))

    def words(self, what: str) -> Any:
        """One of `WORDS` at all points, (n1, n2, ..., Q) of text; "" if not made."""
        none = [None] * len(self.questions)
        table = [[getattr(each, what, "") for each in answers or none] for answers in self.answers]
        return np.array(table, dtype=object).reshape(*self.shape, len(self.questions))

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row a point and question that was answered: the point, the question, and its answer."""
        return [{**point, "question": question, **answer.to_dict()} for point, question, answer in self._answered]

    @property
    def _answered(self) -> Iterator[tuple[dict[str, float], str, Answer]]:
        for point, answers in zip(self.points, self.answers, strict=True):
            for question, answer in zip(self.questions, answers or (), strict=False):
                yield point, question, answer

    @property
    def headline(self) -> str:
        """One line: the size of the scan, how it was answered, and the cost."""
        done = [each for answers in self.answers if answers for each in answers]
        points = sum(answers is not None for answers in self.answers)
        of_all = "" if self.is_complete else f" of {len(self.answers)}"
        counts = {kind: sum(each.kind == kind for each in done) for kind in IN_WORDS}
        told = ", ".join(f"{n} {IN_WORDS[kind]}" for kind, n in counts.items() if n)
        grid = " x ".join(f"{name} ({len(values)})" for name, values in self.over.items())
        asked = counted(len(self.questions), "question")
        of_points = counted(len(self.answers), "point").split()[1]
        return f"{points}{of_all} {of_points} of {grid}, {asked}: {told}; {self.cpu_seconds:.2g} s CPU"

    def summary(self) -> ResultTable:
        """The rows, at most `MOST_ROWS` of them, and what their bounds mean."""
        rows = [
            [*(f"{value:.6g}" for value in point.values()), question, *_cells(answer), f"{answer.cpu_seconds:.2g}"]
            for point, question, answer in self._answered
        ]
        notes = [f"times in {self.time_unit}"] if self.time_unit else []
        notes += ["low and high: bounds (proven or estimated) if solved, 95 % intervals if sampled"]
        whys = dict.fromkeys(each.why for answers in self.answers for each in answers or () if each.kind == NONE)
        notes += [f"none: {why}" for why in list(whys)[:MOST_WHYS]]
        if len(whys) > MOST_WHYS:
            notes.append(f"none: {len(whys) - MOST_WHYS} more reasons, in the column why")
        if len(rows) > MOST_ROWS:
            notes.append(f"{len(rows) - MOST_ROWS} more rows; they are in the files, in JSON and in to_dataframe()")
        titles = [*self.over, "question", "value", "bounds", "kind, method", "by", "s CPU"]
        return ResultTable(self.headline, titles, rows[:MOST_ROWS], notes)

    def to_dataframe(self) -> pd.DataFrame:
        """One row a point and question that was answered."""
        return dataframe(self.rows, columns=[*self.over, "question", *Answer.__dataclass_fields__])

    def to_xarray(self) -> xr.Dataset:
        """A Dataset with a dimension for each scanned name and one for the question; nan if not made."""
        dims = (*self.over, "question")
        content = {what: (dims, self.numbers(what)) for what in NUMBERS}
        content |= {what: (dims, self.words(what).astype(str)) for what in WORDS}
        found = dataset(content, {**self.over, "question": list(self.questions)})
        found.attrs["time_unit"] = self.time_unit
        for name, label in self.labels.items():
            found[name].attrs["long_name"] = label
        return found

    def plot(self, figure: Any = None) -> Any:
        """Draw every question: lines with bounds over one name, a heat map over two, one for each value of more.

        figure : Matplotlib's, to be drawn into; a new one where none is given. Returns it.
        """
        if figure is None:
            figure = plt.figure(figsize=size_of(self), layout="constrained")
        draw_scan(figure, self)
        return figure

    def save_page(self, path: str | Path) -> Path:
        """Write an interactive page of all answers, about 5 MB of HTML that need no network; returns the path."""
        return write_whole(path, scan_page(self, self.headline, self.questions))


def grid_points(over: Mapping[str, Floats]) -> Iterator[dict[str, float]]:
    """Every combination of the values, the last name going fastest."""
    for values in itertools.product(*(column.tolist() for column in over.values())):
        yield dict(zip(over, values, strict=True))


def _cells(answer: Answer) -> tuple[str, str, str, str]:
    """Value, bounds, their kind and the method, and the states or runs that they rest on."""
    if answer.kind == NONE:
        return "", "", NONE, ""
    return f"{answer.value:.6g}", answer.bounds_text, f"{answer.kind}, {answer.method}", answer.why
