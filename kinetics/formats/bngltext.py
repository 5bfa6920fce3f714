"""The text of a BNGL file as BioNetGen lexes it: comments, lines that go on, and the pieces of a line.

What cannot be read without doubt is refused: BioNetGen, a Perl program, evaluates some of what it reads.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from kinetics.network.laws.reading import LONGEST, NUMBER

NAME = r"[A-Za-z_]\w*"
WORD = r"\w+"
BLANKS = " \t"
# In an expression: what may stand before a number, name or parenthesis, and what between two of them.
SIGNS = r"[-+!~]"
OPERATORS = r"\*\*|>=|<=|==|!=|~=|&&|\|\||[-+*/^<>]"
REFUSED = {
    "tfun": "a function from a file (tfun), which is not read",
    "functionproduct": "FunctionProduct, which NFsim alone simulates; write one rate",
    "totalrate": "TotalRate, which BioNetGen leaves out of the network; write the rate of one way to react",
}


class BnglLine:
    """A line, joined with those that it goes on in, and how far it is read.

    number : of its first line in the file, from 1
    """

    def __init__(self, path: Path, number: int, text: str) -> None:
        self.path, self.number, self.text, self.place = path, number, text, 0

    def wrong(self, fault: str) -> ValueError:
        """What is wrong with the line, for the user."""
        return ValueError(f"{self.path}, line {self.number}: {fault}")

    def unreadable(self, expected: str) -> ValueError:
        """ValueError with the expected and the given text."""
        rest = self.text[self.place : self.place + 80].strip(BLANKS)
        return self.wrong(f"{rest[:40]!r} came; expected {expected}" if rest else f"the line ends; expected {expected}")

    def take(self, pattern: str) -> str:
        """The text here if it matches the pattern; else ""."""
        found = re.compile(pattern, re.ASCII).match(self.text, self.place)
        self.place = found.end() if found else self.place
        return found[0] if found else ""

    def need(self, pattern: str, expected: str) -> str:
        """The text here, which must match the pattern."""
        if not re.compile(pattern, re.ASCII).match(self.text, self.place):
            raise self.unreadable(expected)
        return self.take(pattern)

    def blank(self) -> bool:
        """Skip blanks; whether there were any, or the line ends here."""
        return bool(self.take(f"[{BLANKS}]+")) or self.at_end

    @property
    def at_end(self) -> bool:
        """Whether all is read; a line ends in no blanks."""
        return self.place >= len(self.text)

    def end(self) -> None:
        """ValueError if more stands in the line."""
        if not self.at_end:
            raise self.unreadable("the end of the line")

    def refuse_names(self) -> None:
        """ValueError if a name stands that BioNetGen reads a file for, or leaves out of the network."""
        found = re.compile(NAME, re.ASCII).match(self.text, self.place)
        if found and (why := REFUSED.get(found[0].lower())):
            raise self.wrong(why)

    def expression(self) -> str:
        """An expression without its blanks: numbers, names, calls, operators, parentheses. It ends if none fits."""
        pieces: list[str] = []
        open_parts: list[bool] = []  # of every parenthesis: whether it holds the arguments of a call
        while True:
            self.take(f"[{BLANKS}]+")
            if sign := self.take(SIGNS):
                pieces.append(sign)
                continue
            self.refuse_names()
            if name := self.take(NAME):
                pieces.append(name)
                if self.take(rf"[{BLANKS}]*\("):
                    pieces.append("(")
                    if not self.take(rf"[{BLANKS}]*\)"):
                        open_parts.append(True)
                        continue
                    pieces.append(")")
            elif self.take(r"\("):
                pieces.append("(")
                open_parts.append(False)
                continue
            else:
                pieces.append(self.need(rf"{NUMBER}(?![\w.])", "a number, a name or a parenthesis"))
            before = self.place
            self.take(f"[{BLANKS}]+")
            while open_parts and self.take(r"\)"):
                pieces.append(")")
                open_parts.pop()
                before = self.place
                self.take(f"[{BLANKS}]+")
            if operator := self.take(OPERATORS) or (self.take(",") if open_parts and open_parts[-1] else ""):
                pieces.append(operator)
            elif open_parts:
                raise self.unreadable("')'")
            else:
                self.place = before
                return "".join(pieces)


def lines_of(path: Path, text: str) -> Iterator[BnglLine]:
    """The lines that hold something, without comments, each joined with those that it goes on in."""
    physical = enumerate(text.split("\n"), 1)
    for number, raw in physical:
        line = _without_comment(raw)
        if not line:
            continue
        joined = []
        while line.endswith("\\"):  # the line goes on, wherever its comment was
            joined.append(line[:-1])
            line = _without_comment(next(physical, (0, ""))[1])
        joined.append(line)
        whole = BnglLine(path, number, "".join(joined).strip(BLANKS))
        if len(whole.text) > LONGEST:
            raise whole.wrong(f"it has {len(whole.text)} characters; at most {LONGEST} are read")
        if odd := re.search(r"[^\t -~]|\\", whole.text):
            raise whole.wrong(f"the character {odd[0]!r}, which BNGL has in comments alone")
        if whole.text:
            yield whole


def _without_comment(line: str) -> str:
    return line.partition("#")[0].rstrip(BLANKS + "\r")
