"""Names and sides of reactions in a text: `A`, `'A-B'`, `2 A + B`."""

from __future__ import annotations

from kinetics.network.laws.graph import Graph
from kinetics.network.laws.reading import Token, node_of, tokens_of
from kinetics.network.laws.writing import quoted
from kinetics.network.source_spans import SourceSpan
from kinetics.support.limits import check_visible

MOST_COPIES = 10**6  # in one place of a reaction


def name_in(span: SourceSpan, what: str) -> str:
    """The one name that a span holds. ValueError, with line and column, for anything else.

    what : what the name stands for, in the message

    >>> name_in(SourceSpan(1, "'A-B'", 0, "'A-B'"), "a species")
    'A-B'
    """
    tokens = span.located(lambda: list(tokens_of(span.text)))
    if len(tokens) != 1:
        raise span.wrong(f"{span.text!r} came where {what} was expected: one word, or any text in quotes")
    return name_of(span, tokens[0])


def name_of(span: SourceSpan, token: Token) -> str:
    """The name that a word or a quoted text of a span stands for."""
    if token.kind == "word":
        if quoted(token.text) != token.text:
            fault = f"{token.text!r} is reserved in formulas; quote it if it is a name"
            raise span.wrong(fault, token.column)
        return token.text
    if token.kind != "quoted":
        fault = f"{token.text!r} came where a name was expected: one word, or any text in quotes"
        raise span.wrong(fault, token.column)
    names: list[str] = []
    here = span.part(token.column, token.column + len(token.text))
    here.located(lambda: node_of(here.text, Graph(), lambda name: names.append(name) or 0))  # type: ignore[func-returns-value]
    here.located(lambda: check_visible("a name", names[0]))
    return names[0]


def side_in(side: SourceSpan, where: str) -> dict[str, int]:
    """Copies of each species on one side of a reaction, which is `where` the arrow: before or after.

    >>> side_in(SourceSpan(1, "2 A + B", 0, "2 A + B"), "before")
    {'A': 2, 'B': 1}
    """
    if side.text in ("0", "∅"):
        return {}
    copies: dict[str, int] = {}
    tokens = [*side.located(lambda: list(tokens_of(side.text))), Token("end", "", len(side.text))]
    i = 0
    while True:
        n = 1
        if tokens[i].kind == "number":
            n = _copies(side, tokens[i])
            i += 1 + (tokens[i + 1].text == "*")
        token = tokens[i]
        if token.kind not in ("word", "quoted"):
            came = f"{token.text!r} came" if token.text else "nothing came"
            fault = f"{came} where a species {where} the arrow was expected; nothing is written 0"
            raise side.wrong(fault, token.column)
        name = name_of(side, token)
        copies[name] = copies.get(name, 0) + n
        token, i = tokens[i + 1], i + 2
        if token.kind == "end":
            return copies
        if token.text != "+":
            raise side.wrong(
                f"{token.text!r} came after {name!r}, {where} the arrow; expected + and a species"
                + (", or a comma and the rate" if where == "after" else ", or the arrow"),
                token.column,
            )


def _copies(side: SourceSpan, token: Token) -> int:
    value = float(token.text)
    if not value.is_integer() or not 1 <= value <= MOST_COPIES:
        expected = f"expected a whole number from 1 to {MOST_COPIES}, or 0 alone for nothing"
        raise side.wrong(f"{token.text} copies; {expected}", token.column)
    return int(value)
