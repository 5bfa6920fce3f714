"""Formulas as text again, with the fewest brackets; what is long and occurs twice is written once, with a name."""

from __future__ import annotations

import keyword
import math
from collections.abc import Sequence

from kinetics.network.laws.graph import Code, Node
from kinetics.network.laws.reading import BEFORE, CALLS, COMPARING, FUNCTIONS, PI, RESERVED, TIME, TWO, WORD

LONGEST_IN_FULL = 2_000  # characters of a text in which nothing has a name
ATOM, CALLED = 10, {code: name for name, code in CALLS.items() if name != "pow"}
SIGNS = {code: (level, sign) for sign, (level, code) in TWO.items() if sign not in (">", ">=")}
FIRST = {code: (level, sign) for sign, (level, code) in BEFORE.items() if code is not None}
FLIPPED = {Code.LESS: ">", Code.LESS_EQUAL: ">="}


def quoted(name: str) -> str:
    """A species' name as an expression writes it."""
    is_word = name.isidentifier() and WORD.fullmatch(name)  # the grammar's words have fewer letters than Python's
    is_plain = is_word and name not in (*RESERVED, *FUNCTIONS) and not keyword.iskeyword(name)
    return name if is_plain else repr(name)


def text_of(formula: Sequence[Node]) -> str:
    """The text of a formula, parts before wholes; of a long one `x1 = ...; x2 = ...; whole`, with its shared parts.

    The work is in proportion to the nodes. A text that is not long has the same values when it is read again.
    """
    if len(formula) == 1:
        return _text(formula[0], [], formula)[0]
    uses = uses_of(formula)
    lengths = _lengths(formula)
    is_long = lengths[-1] > LONGEST_IN_FULL
    used = {node.value for node in formula if node.code == Code.COUNT}
    definitions: list[str] = []
    texts: dict[int, tuple[str, int]] = {}  # and how strongly they bind; those that are still needed
    for place, node in enumerate(formula):
        parts = [texts[part] for part in node.parts]
        for part in node.parts:
            uses[part] -= 1
            if not uses[part]:
                texts.pop(part, None)
        text, level = _text(node, parts, formula)
        is_part = is_long and bool(node.parts) and place < len(formula) - 1
        if is_part and (uses[place] > 1 or len(text) > LONGEST_IN_FULL):
            name = f"x{len(definitions) + 1}"
            while name in used:
                name += "_"
            definitions.append(f"{name} = {text}")
            text, level = name, ATOM
        texts[place] = text, level
    return "; ".join([*definitions, texts[len(formula) - 1][0]])


def uses_of(formula: Sequence[Node]) -> list[int]:
    """How often each node is a part of another."""
    uses = [0] * len(formula)
    for node in formula:
        for part in node.parts:
            uses[part] += 1
    return uses


def number_text(value: float) -> str:
    """A number as text, without a decimal point if it is whole; pi by its name."""
    if value == math.pi:
        return PI
    is_whole = value == int(value) and abs(value) < 1e15
    return repr(int(value)) if is_whole and repr(value) != "-0.0" else repr(value)


def _lengths(formula: Sequence[Node]) -> list[int]:
    """About the characters that each node has in full; those beyond the longest are all one."""
    lengths: list[int] = []
    for node in formula:
        own = len(str(node.value)) if node.code == Code.COUNT else 4
        lengths.append(min(own + sum(lengths[part] for part in node.parts), 2 * LONGEST_IN_FULL))
    return lengths


def _text(node: Node, parts: list[tuple[str, int]], formula: Sequence[Node]) -> tuple[str, int]:
    code = node.code
    if code == Code.CONSTANT:
        value = float(node.value)
        return number_text(value), FIRST[Code.NEGATE][0] if math.copysign(1.0, value) < 0 else ATOM
    if code == Code.COUNT:
        return quoted(str(node.value)), ATOM
    if code == Code.CLOCK:
        return TIME, ATOM
    if code == Code.SELECT:
        other = parts[2][0]
        is_chain = formula[node.parts[2]].code == Code.SELECT and other.startswith("piecewise(")
        last = other.removeprefix("piecewise(") if is_chain else f"{other})"
        return f"piecewise({parts[0][0]}, {parts[1][0]}, {last}", ATOM
    if code in CALLED:
        return f"{CALLED[code]}({', '.join(text for text, _ in parts)})", ATOM
    if code in FIRST:
        level, sign = FIRST[code]
        return f"{sign}{' ' * sign.isalpha()}{_within(parts[0], level)}", level
    level, sign = SIGNS[code]
    left, right = parts
    if code in FLIPPED and formula[node.parts[0]].code == Code.CONSTANT:
        left, right, sign = right, left, FLIPPED[code]
    if code == Code.POWER:  # from right to left, and a sign before its right side binds to that
        return f"{_within(left, level + 1)} ** {_within(right, FIRST[Code.NEGATE][0])}", level
    return f"{_within(left, level + (level == COMPARING))} {sign} {_within(right, level + 1)}", level


def _within(part: tuple[str, int], level: int) -> str:
    return part[0] if part[1] >= level else f"({part[0]})"
