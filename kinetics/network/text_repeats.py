"""Repeated lines and numbered names in a text of reactions: `for i in 1..5: A[i] -> A[i+1], k`.

`A[3]` is another spelling of the name `A_3`, in any line. In a repeated line an index is a formula of the line's
number, and the number's name anywhere else is the number.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Graph
from kinetics.network.laws.program import evaluate, steps_of
from kinetics.network.laws.reading import LONGEST, NUMBER, WORD, node_of
from kinetics.network.laws.writing import quoted
from kinetics.network.source_spans import QUOTED, SourceSpan
from kinetics.support.arrays import Ints

MOST_LINES = 10_000  # that a text may make by repetition
MOST_CHARACTERS = 10**7  # of them
LARGEST = 10**9  # index, or number of a line
OPENING = re.compile(r"\s*for\s+(?=[^\W\d])")
HEAD = re.compile(rf"\s*for\s+(?P<name>{WORD.pattern})\s+in\s+(?P<first>[0-9]+)\s*\.\.\s*(?P<last>[0-9]+)\s*:")
PIECE = re.compile(
    rf"(?P<comment>\#.*)|(?P<quoted>{QUOTED})|(?P<number>{NUMBER})"
    rf"|(?P<word>{WORD.pattern})(?P<index>\[[^\[\]\#]*\])?|(?P<other>.)",
    re.DOTALL,
)
FORM = "expected a repeated line such as 'for i in 1..5: A[i] -> A[i+1], k'"


class Numbered(NamedTuple):
    """A name with an index: its word, and its index (N,) in each repetition."""

    word: str
    indices: Ints


def expanded(text: str) -> list[SourceSpan]:
    """The lines of a text, repeated ones written out. ValueError, with line and column, for a wrong or long repetition.

    A message on a line that was written out shows it so, and counts its columns there.

    >>> [line.text for line in expanded("for i in 1..2: A[i] -> A[i + 1], k * i")]
    ['A_1 -> A_2, k * 1', 'A_2 -> A_3, k * 2']
    """
    lines: list[SourceSpan] = []
    n_made = n_characters = 0
    for number, line in enumerate(text.splitlines(), 1):
        span = SourceSpan(number, line, 0, line)
        is_repeated = OPENING.match(line) is not None
        if len(line) > LONGEST or not (is_repeated or "[" in line):
            lines.append(span)
            continue
        for made in _repeated(span, MOST_LINES - n_made) if is_repeated else _written_out(span, "", np.zeros(1, int)):
            n_made += is_repeated
            n_characters += len(made) * is_repeated
            if n_characters > MOST_CHARACTERS:
                raise span.wrong(f"over {MOST_CHARACTERS} characters by repetition in this text; repeat fewer")
            lines.append(SourceSpan(number, made, 0, made))
    return lines


def _repeated(span: SourceSpan, left: int) -> Iterator[str]:
    """A line that begins with `for`, of which the text may make so many more."""
    head = HEAD.match(span.text)
    if head is None:
        raise span.part(0).wrong(f"this repetition cannot be read; {FORM}")
    if quoted(head["name"]) != head["name"]:
        raise span.wrong(
            f"{head['name']!r} is reserved in formulas; expected another name, such as i", head.start("name")
        )
    ends = []
    for key in ("first", "last"):
        value = int(head[key]) if len(head[key]) <= 10 else LARGEST + 1
        if value > LARGEST:
            raise span.wrong(f"a number beyond {LARGEST}", head.start(key))
        ends.append(value)
    first, last = ends
    if last < first:
        raise span.wrong(f"{first}..{last} holds no number; expected the smaller one first", head.start("first"))
    if last - first >= left:
        raise span.wrong(f"over {MOST_LINES} lines by repetition in this text; repeat fewer", head.start("first"))
    body = span.part(head.end())
    if not body.text or OPENING.match(body.text):
        raise body.wrong(f"{'another repetition' if body.text else 'nothing'} to repeat; {FORM}")
    return _written_out(body, head["name"], np.arange(first, last + 1))


def _written_out(span: SourceSpan, name: str, numbers: Ints) -> Iterator[str]:
    """A line once for each number (N,), in place of which it has a name; "" for none."""
    pieces: list[str | Numbered | None] = []  # None for the number itself
    for found in PIECE.finditer(span.text):
        if found["index"]:
            pieces.append(Numbered(found["word"], _indices(span, found, name, numbers)))
        elif found.lastgroup != "comment":
            pieces.append(None if found["word"] == name and name else found[0])
    for i, number in enumerate(numbers.tolist()):
        yield "".join(
            f"{piece.word}_{piece.indices[i]}"
            if isinstance(piece, Numbered)
            else str(number)
            if piece is None
            else piece
            for piece in pieces
        )


def _indices(span: SourceSpan, found: re.Match[str], name: str, numbers: Ints) -> Ints:
    """The index (N,) of a name, for each number."""
    begin = found.start("index") + 1
    part = span.part(begin, found.end() - 1)

    def read() -> Ints:
        graph = Graph()

        def named(word: str) -> int:
            if word != name or not name:
                expected = f"{name!r} and numbers" if name else "a number"
                raise ValueError(f"{word!r} in an index; expected {expected} alone")
            return graph.name(word)

        formula = Expression.of(graph.formula(node_of(part.text, graph, named)))
        if formula.reads_time:
            raise ValueError("the time in an index; expected whole numbers")
        values = evaluate(steps_of(formula, {name: 0}), numbers[:, None], 0.0)
        for value in values.tolist():
            if not (0 <= value <= LARGEST and value.is_integer()):
                raise ValueError(f"the index comes to {value:g}; expected a whole number from 0 to {LARGEST}")
        return values.astype(np.int64)

    return part.located(read)
