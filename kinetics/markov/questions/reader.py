"""The common reader of questions: the frame around what is asked, time bounds, and the condition behind them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from kinetics.network.laws.reading import LONGEST, shortened

FRAME = re.compile(r'([A-Z])\s*(?:\{\s*"([^"]*)"\s*\}\s*)?=\s*\?\s*\[(.*)\]', re.DOTALL)
MEAN = re.compile(r"E\s*\[(.*)\]\s*@(.*)", re.DOTALL)
INTERVAL = re.compile(r"\s*\[\s*([^\s\[\],]+)\s*,\s*([^\s\[\],]+)\s*\]")
BOUND = re.compile(r"\s*(<=|<|>=|>|=|\[)\s*([^\s\[\],]+)")


class Framed(NamedTuple):
    """A question in its frame: a letter, the name of a reward or None, and what stands in the brackets.

    Of `E[name] @ t`, the letter E, and the time as text.
    """

    letter: str
    name: str | None
    inner: str

    def begins_with(self, letters: str) -> str:
        """Which of the letters the brackets begin with, as a word; "" for none."""
        word = re.match(rf"([{letters}])(?![\w'\"])", self.inner)
        return word[1] if word else ""


def framed(question: str, forms: str) -> Framed:
    """The frame of a question; a ValueError if there is none, with the forms that are read."""
    if not isinstance(question, str):
        raise ValueError(f"{question!r} is no question; expected text, as in 'P=? [ F<=100 A >= 1 ]'")
    if len(question) > LONGEST:
        raise ValueError(f"a question of {len(question)} characters; at most {LONGEST} are read")
    mean = MEAN.fullmatch(question.strip())
    if mean:
        return Framed("E", mean[1].strip().strip("\"'"), mean[2].strip())
    found = FRAME.fullmatch(question.strip())
    if not found:
        raise ValueError(f"cannot read the question {shortened(question)!r}; {forms}")
    letter, name, inner = found.groups()
    if name is not None and letter != "R":
        raise ValueError(f"{shortened(question)!r}: only R takes a reward's name; {forms}")
    if not inner.strip():
        raise ValueError(f"{shortened(question)!r}: nothing is asked for; {forms}")
    return Framed(letter, name, inner.strip())


class Bounded(NamedTuple):
    """A condition, and from when and until when it counts, tu; `by` is None for ever."""

    after: float
    by: float | None
    states: str

    @classmethod
    def of(cls, text: str) -> Bounded:
        """The time bound that a text begins with, if any, <= t or [a, b], and the condition behind it."""
        interval, bound = INTERVAL.match(text), BOUND.match(text)
        after, by = 0.0, None
        if interval:
            after, by = time_of(interval[1]), time_of(interval[2])
            if after > by:
                raise ValueError(f"a time bound {interval[0].strip()!r}; expected [a, b] with a <= b")
        elif bound:
            if bound[1] not in ("<=", "<"):
                raise ValueError(f"a time bound {bound[0].strip()!r}; only <= t and [a, b] are answered")
            by = time_of(bound[2])
        found = interval or bound
        states = (text[found.end() :] if found else text).strip()
        if not states:
            raise ValueError("a condition is missing")
        return cls(after, by, states)


def one_bound(text: str, word: str, sign: str) -> float:
    """The time of a text that is a bound of one sign alone, behind a word."""
    bound = BOUND.match(text)
    if not bound or bound[1] != sign or text[bound.end() :].strip():
        raise ValueError(f"{shortened(word + text)!r}; expected {word}{sign}t, as in {word}{sign}100")
    return time_of(bound[2])


def time_of(text: str) -> float:
    """A time, tu, read from text; a ValueError if it is negative or not finite."""
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{text!r} is no time; expected a number of tu, with a space behind it") from None
    if not 0.0 <= value < math.inf:
        raise ValueError(f"time {text}; expected a finite number of at least 0")
    return value


def words(text: str, word: str) -> list[int]:
    """The places of a word in a text, outside of brackets and quotes."""
    pattern = re.compile(rf"{word}(?!\w)")
    return [place for place in _top_level(text) if pattern.match(text, place)]


def _top_level(text: str) -> Iterator[int]:
    """The places at which words begin, outside of brackets and quotes."""
    depth, quote = 0, ""
    for place, sign in enumerate(text):
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        elif sign in "()":
            depth += 1 if sign == "(" else -1
        elif not depth and not (place and re.match(r"\w", text[place - 1])):
            yield place
