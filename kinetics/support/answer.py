"""`Answer`: a value with its bounds, their kind, the method and the CPU time; `TruthValue`, a true or false one."""

from __future__ import annotations

import html
import math
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from typing import Any

from kinetics.support.tables import figure

PROVEN, ESTIMATE, CONFIDENCE, NONE = KINDS = ("proven", "estimate", "95 % confidence", "none")
UNDECIDED = "not decided within the bound"
LOPSIDED = 100.0  # times as wide on the upper side as on the lower: the value says little, and both bounds are shown
CLOSE = 1e-5  # relative width of bounds that agree in all digits that a table shows


@dataclass(frozen=True)
class Answer:
    """A value with bounds on the true one.

    value : nan if there is no answer
    low, high : bounds; all roundings and truncations, and those of the rates, are included. nan if none are known
    kind : `proven`; `estimate` where the bounds are not proven; `95 % confidence` for an interval from runs or from
        draws of the rates; `none` if there is no answer
    method : how it was found
    cpu_seconds : processor time that this took
    why : how many states or runs it rests on; if there is no answer, the reason

    >>> from math import exp
    >>> from kinetics import Chain
    >>> answer = Chain([[0.0, 0.1], [2.0, 0.0]], initial=0).until([False, True], by=10.0)
    >>> answer.low <= 1 - exp(-1) <= answer.high, answer.high - answer.low < 1e-12, answer.kind, answer.why
    (True, True, 'proven', '2 states')
    """

    value: float
    low: float
    high: float
    kind: str = PROVEN
    method: str = ""
    cpu_seconds: float = 0.0
    why: str = ""

    @classmethod
    def within(cls, value: float, relative: float, is_bound: bool, absolute: float = 0.0) -> Answer:
        """A value of at least 0 with bounds from a relative and an absolute error."""
        wide = relative * value * 1.001 + absolute
        return cls(value, max(value - wide, 0.0), value + wide, kind_of(is_bound))

    @classmethod
    def none(cls, why: str) -> Answer:
        """No answer, and why there is none."""
        return cls(math.nan, math.nan, math.nan, NONE, why=why)

    @property
    def is_bound(self) -> bool:
        """Whether the bounds are proven."""
        return self.kind == PROVEN

    @property
    def error(self) -> float:
        """How far the bounds reach from the value at most."""
        return max(self.high - self.value, self.value - self.low)

    def inflated(self, relative: float) -> Answer:
        """The bounds widened by a further relative error, for a sum of terms of at least 0."""
        more = 1.001 * relative
        return replace(self, low=self.low * (1.0 - more), high=self.high * (1.0 + more))

    def clipped(self) -> Answer:
        """Value and bounds of a probability, at most 1."""
        return replace(self, value=min(self.value, 1.0), low=min(self.low, 1.0), high=min(self.high, 1.0))

    def to_dict(self) -> dict[str, Any]:
        """All fields by name, as in the JSON of every command."""
        return asdict(self)

    @property
    def bounds_text(self) -> str:
        """The bounds as a cell of a table: an interval, or one error if all digits shown agree."""
        if math.isnan(self.low):
            return "" if self.kind == NONE else "all runs alike"
        if self.error <= CLOSE * abs(self.value):
            return f"± {self.error:.1g}"
        return f"[{figure(self.low, '.6g')}, {figure(self.high, '.6g')}]"

    def __str__(self) -> str:
        if self.kind == NONE:
            return f"no answer: {self.why}"
        found = "; ".join(filter(None, [self.kind, self.method]))
        if self.kind == CONFIDENCE:
            return f"{self.value:.6g} {self.bounds_text} ({found}; {self.why})"
        if self.high == math.inf:
            return f"at least {self.low:.12g} ({found})"
        if self.high - self.value > LOPSIDED * (self.value - self.low):
            return f"{self.low:.12g} to {self.high:.12g} ({found})"
        relative = f", {self.error / abs(self.value):.1e} of it" if self.value and self.error else ""
        return f"{self.value:.12g} (+- {self.error:.1e}{relative}, {found})"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(str(self))}</p>"


@dataclass(frozen=True)
class TruthValue(Answer):
    """An answer that is true (1) or false (0), or not decided within the bound (nan, between 0 and 1).

    As a condition of Python it is True or False; a ValueError if it is not decided.

    >>> from kinetics import Chain
    >>> from kinetics.markov import ask
    >>> pump = Chain([[0.0, 0.1], [2.0, 0.0]], initial=0, labels={"down": [False, True]})
    >>> found = ask(pump, 'P>=0.5 [ F<=10 "down" ]')
    >>> found.holds, found.value, found.why
    (True, 1.0, '0.632120558829 >= 0.5')
    """

    @classmethod
    def of(cls, answer: Answer, sign: str, limit: str) -> TruthValue:
        """Whether an answer is on one side of a limit, with both of its bounds; sign : <, <=, > or >=.

        limit : a number as text, taken exactly
        """
        if answer.kind == NONE:
            return cls.undecided(answer.why, answer)
        above, below = beyond(answer.low, answer.high, sign, limit)
        if above == below:
            told = f"{answer.value:.12g} lies between {answer.low:.17g} and {answer.high:.17g}"
            return cls.undecided(f"{told}, which does not decide {sign} {limit}", answer)
        shown = f"{answer.value:.12g} {sign} {limit}"
        return cls.sure(bool(above), replace(answer, why=shown if above else f"not {shown}"))

    @classmethod
    def sure(cls, holds: bool, answer: Answer) -> TruthValue:
        """True or false, by the kind, method and reason of an answer."""
        value = float(holds)
        return cls(value, value, value, answer.kind, answer.method, answer.cpu_seconds, answer.why)

    @classmethod
    def undecided(cls, why: str, answer: Answer) -> TruthValue:
        """Not decided within the bound, and why, by the method of an answer."""
        told = why if why.startswith(UNDECIDED) else f"{UNDECIDED}: {why}"
        return cls(math.nan, 0.0, 1.0, NONE, answer.method, answer.cpu_seconds, told)

    @property
    def holds(self) -> bool | None:
        """True or false; None if that is not decided."""
        return None if self.kind == NONE else self.value == 1.0

    def __bool__(self) -> bool:
        if self.holds is None:
            raise ValueError(self.why)
        return self.holds

    def __str__(self) -> str:
        if self.holds is None:
            return self.why
        return f"{str(self.holds).lower()} ({'; '.join(filter(None, [self.why, self.kind, self.method]))})"


def beyond(low: Any, high: Any, sign: str, limit: str) -> tuple[Any, Any]:
    """Whether what lies between bounds certainly holds to a sign and a limit, and whether it certainly does not.

    low, high : numbers, or arrays of them; limit : a number as text, which may be no double
    """
    exact = Fraction(limit)
    nearest = float(exact)
    # Of doubles, x >= limit is x >= the next double at or above it, and x > limit is x > the one at or below it.
    upper = nearest if Fraction(nearest) >= exact else math.nextafter(nearest, math.inf)
    lower = nearest if Fraction(nearest) <= exact else math.nextafter(nearest, -math.inf)
    match sign:
        case ">=":
            return low >= upper, high < upper
        case "<":
            return high < upper, low >= upper
        case ">":
            return low > lower, high <= lower
        case "<=":
            return high <= lower, low > lower
    raise ValueError(f"{sign!r}; expected <, <=, > or >=")


def kind_of(is_bound: bool) -> str:
    """The kind of an answer whose bounds are proven, or not."""
    return PROVEN if is_bound else ESTIMATE


def weakest(*answers: Answer) -> str:
    """The kind of bounds that rest on those of several answers."""
    return max((each.kind for each in answers), key=KINDS.index)
