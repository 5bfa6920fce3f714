"""Questions to a chain as text, in the notation of PRISM and Storm: `P=? [ F<=100 quadmer >= 1 ]`.

    P=? [ F phi ]  P=? [ G phi ]  P=? [ phi U psi ]    each also with a time bound: F<=100, G<=100, U<=100
    S=? [ phi ]                                         after infinite time
    R{"name"}=? [ I=t ]  [ C<=t ]  [ F phi ]  [ S ]     rate at a time, total up to t or until phi, steady rate
    E[name] @ t                                         the first of these for short: the mean of a count at a time
    R{"time"}=? [ F phi ]                               mean time until phi

phi and psi are conditions on counts and labels: see `network.predicates`. The words F, G, U, I, C and S stand for
themselves only where these forms have them; a species with such a name is quoted: F "S" >= 1.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain
from kinetics.network.laws.reading import LONGEST, shortened
from kinetics.network.predicates import StateNames, names_in
from kinetics.support.answer import Answer

Answer_co = TypeVar("Answer_co", covariant=True)
FRAME = re.compile(r'(P|S|R)\s*(?:\{\s*"([^"]*)"\s*\}\s*)?=\s*\?\s*\[(.*)\]', re.DOTALL)
MEAN = re.compile(r"E\s*\[(.*)\]\s*@(.*)", re.DOTALL)
BOUND = re.compile(r"\s*(<=|<|>=|>|=|\[)\s*([^\s\[\],]+)")
FORMS = (
    'expected P=? [ F phi ], P=? [ G phi ], P=? [ phi U psi ], S=? [ phi ], R{"name"}=? [ I=t | C<=t | F phi | S ] or '
    "E[name] @ t"
)


class Answering(Protocol[Answer_co]):
    """What answers the questions: a `Chain`, or a `Sensitivity`."""

    def until(self, target: str, through: str | None = None, by: float | None = None) -> Answer_co:
        """P=? [ through U<=by target ]."""
        ...

    def always(self, states: str, by: float | None = None) -> Answer_co:
        """P=? [ G<=by states ]."""
        ...

    def steady_state(self, states: str) -> Answer_co:
        """S=? [ states ]."""
        ...

    def reward(
        self, name: str | None, at: float | None, up_to: float | None, until: str | None, stationary: bool
    ) -> Answer_co:
        """R=? [ ... ]."""
        ...


class Settled(NamedTuple):
    """Where the answer to a question is settled, however the chain goes on: in a target, and outside of some states.

    Both are conditions, None where there is none.
    """

    target: str | None
    through: str | None

    def holds(self, names: StateNames) -> NDArray[np.bool_]:
        """In which of the states (N,)."""
        found = np.zeros(names.n_states, dtype=bool)
        if self.target is not None:
            found |= names.holds(self.target)
        return found if self.through is None else found | ~names.holds(self.through)

    @property
    def names(self) -> set[str]:
        """The variables and labels that both conditions name."""
        return {name for text in self if text is not None for name in names_in(text)}


@dataclass(frozen=True)
class UntilQuery:
    """P=? [ through U<=by target ]; F without `through`."""

    target: str
    through: str | None = None
    by: float | None = None

    def of(self, chain: Answering[Answer_co]) -> Answer_co:
        """The answer of a chain, or its derivatives of a `Sensitivity`."""
        return chain.until(self.target, self.through, self.by)

    @property
    def settled(self) -> Settled | None:
        """Where the answer is settled; None where that is nowhere."""
        return Settled(self.target, self.through)


@dataclass(frozen=True)
class AlwaysQuery:
    """P=? [ G<=by states ]."""

    states: str
    by: float | None = None

    def of(self, chain: Answering[Answer_co]) -> Answer_co:
        """The answer of a chain, or its derivatives of a `Sensitivity`."""
        return chain.always(self.states, self.by)

    @property
    def settled(self) -> Settled | None:
        """Where the answer is settled; None where that is nowhere."""
        return Settled(None, self.states)


@dataclass(frozen=True)
class StationaryQuery:
    """S=? [ states ]."""

    states: str

    def of(self, chain: Answering[Answer_co]) -> Answer_co:
        """The answer of a chain, or its derivatives of a `Sensitivity`."""
        return chain.steady_state(self.states)

    @property
    def settled(self) -> Settled | None:
        """Where the answer is settled; None where that is nowhere."""
        return None


@dataclass(frozen=True)
class RewardQuery:
    """R{"name"}=? [ ... ], in one of its four forms."""

    name: str | None = None
    at: float | None = None
    up_to: float | None = None
    until: str | None = None

    def of(self, chain: Answering[Answer_co]) -> Answer_co:
        """The answer of a chain, or its derivatives of a `Sensitivity`."""
        stationary = self.at is None and self.up_to is None and self.until is None
        return chain.reward(self.name, self.at, self.up_to, self.until, stationary)

    @property
    def settled(self) -> Settled | None:
        """Where the answer is settled; None where that is nowhere."""
        return None if self.until is None else Settled(self.until, None)


Query = UntilQuery | AlwaysQuery | StationaryQuery | RewardQuery


def ask(chain: Chain, question: str) -> Answer:
    """The answer of a chain to a question as text; a ValueError where it cannot be read or has no finite answer.

    question : in the notation of PRISM and Storm, such as `P=? [ F<=100 A >= 1 ]`, with `U`, `G`, `S=?` and `R=?` too

    >>> from kinetics import Chain, Network
    >>> from kinetics.markov import ask
    >>> chain = Chain.of(Network.from_text("A <-> B, 2, 3"), {"A": 1})
    >>> round(ask(chain, "S=? [ B == 1 ]").value, 9), round(ask(chain, 'R{"A"}=? [ F B == 1 ]').value, 9)  # 2/5, 1/2
    (0.4, 0.5)
    >>> round(ask(chain, "P=? [ F<=0.5 B == 1 ]").value, 6)  # 1 - 1/e
    0.632121
    """
    return parse(question).of(chain)


def parse(question: str) -> Query:
    """The question that a text asks; conditions in it are read when they meet a chain, which has their names."""
    if not isinstance(question, str):
        raise ValueError(f"{question!r} is no question; expected text, as in 'P=? [ F<=100 A >= 1 ]'")
    if len(question) > LONGEST:
        raise ValueError(f"a question of {len(question)} characters; at most {LONGEST} are read")
    mean = MEAN.fullmatch(question.strip())
    if mean:
        return _mean(question, mean[1].strip().strip("\"'"), mean[2].strip())
    found = FRAME.fullmatch(question.strip())
    if not found:
        raise ValueError(f"cannot read the question {shortened(question)!r}; {FORMS}")
    kind, name, inner = found.groups()
    if name is not None and kind != "R":
        raise ValueError(f"{shortened(question)!r}: only R takes a reward's name; {FORMS}")
    if not inner.strip():
        raise ValueError(f"{shortened(question)!r}: nothing is asked for; {FORMS}")
    try:
        if kind == "S":
            return StationaryQuery(inner.strip())
        return _path(inner.strip()) if kind == "P" else _reward(name, inner.strip())
    except ValueError as error:
        raise ValueError(f"cannot read the question {shortened(question)!r}: {error}") from None


def _mean(question: str, name: str, time: str) -> RewardQuery:
    if not name or not time:
        raise ValueError(f"cannot read the question {shortened(question)!r}; expected E[name] @ t, as in E[AB] @ 100")
    try:
        return RewardQuery(name, at=_time(time))
    except ValueError as error:
        raise ValueError(f"cannot read the question {shortened(question)!r}: {error}") from None


def _path(text: str) -> Query:
    word = re.match(r"(F|G)(?![\w'\"])", text)
    if word:
        by, states = _bounded(text[1:])
        return UntilQuery(states, None, by) if word[1] == "F" else AlwaysQuery(states, by)
    places = [place for place in _top_level(text) if re.compile(r"U(?!\w)").match(text, place)]
    if len(places) != 1:
        raise ValueError(
            f"{shortened(text)!r} has {len(places)} times U where one is expected, and no F or G before it"
        )
    through = text[: places[0]].strip()
    if not through:
        raise ValueError("nothing stands before U; write F psi, or true U psi")
    by, target = _bounded(text[places[0] + 1 :])
    return UntilQuery(target, through, by)


def _reward(name: str | None, text: str) -> RewardQuery:
    if text == "S":
        return RewardQuery(name)
    word = re.match(r"(I|C|F)(?![\w'\"])", text)
    if not word:
        raise ValueError(f"{shortened(text)!r} is no question of a reward; expected I=t, C<=t, F phi or S")
    if word[1] == "F":
        by, states = _bounded(text[1:])
        if by is not None:
            raise ValueError("a reward until a target takes no time bound; ask for C<=t")
        return RewardQuery(name, until=states)
    bound = BOUND.match(text[1:])
    sign = "=" if word[1] == "I" else "<="
    if not bound or bound[1] != sign or text[1 + bound.end() :].strip():
        raise ValueError(f"{shortened(text)!r}; expected {word[1]}{sign}t, as in {word[1]}{sign}100")
    t = _time(bound[2])
    return RewardQuery(name, at=t) if sign == "=" else RewardQuery(name, up_to=t)


def _bounded(text: str) -> tuple[float | None, str]:
    """The time bound that a text begins with, if any, and the condition after it."""
    bound = BOUND.match(text)
    if bound and bound[1] not in ("<=", "<"):
        raise ValueError(f"a time bound {bound[0].strip()!r}; only <= t is answered")
    states = (text[bound.end() :] if bound else text).strip()
    if not states:
        raise ValueError("a condition is missing")
    return (_time(bound[2]) if bound else None), states


def _time(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{text!r} is no time; expected a number of tu, with a space behind it") from None
    if not 0.0 <= value < math.inf:
        raise ValueError(f"time {text}; expected a finite number of at least 0")
    return value


def _top_level(text: str) -> Iterator[int]:
    """Where words begin that are in no brackets and no quotes."""
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
