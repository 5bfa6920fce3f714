"""Source spans: parts of a line that keep their position, so that an error names line and column."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

from kinetics.network.laws.reading import MOST_SHOWN, FormulaError, around

QUOTED = r"'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\""
MARK = re.compile(
    rf"(?P<quoted>{QUOTED})|(?P<open>['\"])|(?P<comment>#)"
    r"|(?P<arrow><[-=]+>|[-=]+>|<-+|[→⇌↔])|(?P<compare>[<>=!]=)|(?P<mark>[=:,()])"
)

T = TypeVar("T")


class Mark(NamedTuple):
    """A sign that divides a line, outside of quotes and brackets."""

    sign: str
    start: int
    end: int


class SourceSpan(NamedTuple):
    """A part of a line.

    number : of the line, from 1
    start : where in the line it begins, from 0
    """

    number: int
    line: str
    start: int
    text: str

    def part(self, begin: int, end: int | None = None) -> SourceSpan:
        """What stands between two places of it, without the blanks about that."""
        text = self.text[begin:end]
        blanks = len(text) - len(text.lstrip())
        return self._replace(start=self.start + begin + blanks, text=text.strip())

    def divided(self) -> tuple[SourceSpan, list[Mark]]:
        """It without its comment, and its marks."""
        marks: list[Mark] = []
        depth = 0
        for found in MARK.finditer(self.text):
            kind, sign = found.lastgroup, found[0]
            if kind == "open":
                raise self.wrong("this quote is never closed", found.start())
            if kind == "comment":
                return self._replace(text=self.text[: found.start()]), marks
            depth += (sign == "(") - (sign == ")")
            if kind in ("arrow", "mark") and depth == 0 and sign not in ("(", ")"):
                marks.append(Mark(sign, *found.span()))
        return self, marks

    def between(self, marks: Sequence[Mark]) -> list[SourceSpan]:
        """The parts that marks divide."""
        begins, ends = [0, *(mark.end for mark in marks)], [*(mark.start for mark in marks), len(self.text)]
        return [self.part(begin, end) for begin, end in zip(begins, ends, strict=True)]

    def located(self, act: Callable[[], T]) -> T:
        """What is done with it; an error says where."""
        try:
            return act()
        except FormulaError as error:
            raise self.wrong(error.fault, error.place) from None
        except ValueError as error:
            raise self.wrong(str(error)) from None

    def wrong(self, fault: str, place: int = 0) -> ValueError:
        """The error of a fault at a place of it."""
        column = self.start + place
        shown = self.line.strip() if len(self.line) <= MOST_SHOWN else around(self.line, column)
        return ValueError(f"line {self.number}, column {column + 1}, {shown!r}: {fault}")
