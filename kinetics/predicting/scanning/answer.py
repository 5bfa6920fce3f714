"""The answer to one question at one point of a scan."""

from __future__ import annotations

from dataclasses import dataclass

PROVEN, ESTIMATED, SAMPLED, UNANSWERED = "proven", "estimated", "sampled", "none"
NUMBERS = ("value", "low", "high", "standard_error", "cpu_seconds")
COUNTS = ("states", "runs")
WORDS = ("answered", "method", "why")


@dataclass(frozen=True)
class ScanAnswer:
    """The answer to one question at one point.

    low, high : limits, proven or estimated, of an exact answer; of a sampled one its 95 % interval, nan where all runs
        are alike
    answered : `proven` or `estimated`, of the limits of an exact answer, `sampled`, or `none`
    standard_error : of a sampled value; nan where it is exact
    states, runs : of the chain, or of the sample; the other is None
    why : why there is no answer, whose value and limits are nan; "" where there is one

    >>> from kinetics import Network, scan
    >>> (point,) = scan(Network.from_text("A -> B, 1"), {"A": [3]}, ["P=? [ F<=1 B >= 1 ]"]).answers
    >>> round(point[0].value, 6), point[0].answered, point[0].states
    (0.950213, 'proven', 4)
    """

    value: float
    low: float
    high: float
    answered: str
    method: str
    cpu_seconds: float
    standard_error: float = float("nan")
    states: int | None = None
    runs: int | None = None
    why: str = ""

    @classmethod
    def none(cls, why: str, states: int | None = None) -> ScanAnswer:
        """That of a question which has none here."""
        nan = float("nan")
        return cls(nan, nan, nan, UNANSWERED, "", 0.0, states=states, why=why)
