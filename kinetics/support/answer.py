"""`Answer`: a value with its bounds, their kind, the method and the CPU time."""

from __future__ import annotations

import html
import math
from dataclasses import asdict, dataclass, replace
from typing import Any

from kinetics.support.tables import figure

PROVEN, ESTIMATE, CONFIDENCE, NONE = KINDS = ("proven", "estimate", "95 % confidence", "none")
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


def kind_of(is_bound: bool) -> str:
    """The kind of an answer whose bounds are proven, or not."""
    return PROVEN if is_bound else ESTIMATE


def weakest(*answers: Answer) -> str:
    """The kind of bounds that rest on those of several answers."""
    return max((each.kind for each in answers), key=KINDS.index)
