"""Truncated runs, which would not have ended, and the messages about them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from kinetics.support.tables import in_unit

REASONS = {
    "events": "it made {events:.3g} events, as many as max_events allows",
    "forecast": "its rate equations forecast over {events:.0e} events until {end:g}, and max_events allows {most:.3g}",
    "stalled": "events came so fast that the clock could not advance",
    "overflow": "a count exceeded 2**63 - 1, or a propensity exceeded 1e308",
}


@dataclass(frozen=True)
class Truncation:
    """The first run of an ensemble that was truncated; figures end before it.

    time : when that was, in `time_unit`; run : its number
    truncated, among : of so many runs, the first of the ensemble, so many did not reach `beyond`
    until, beyond : the last time of the figures, None if there is none; the first time that was left out
    end : the last time asked for
    channel, propensity : that with the largest propensity in its last state, 1/time_unit; "" if there is none
    reason : one of `REASONS`; events : that it made or, if they are forecast, would come to
    max_events : the most events of a run

    >>> from kinetics import Network, simulate
    >>> explosion = Network.from_text("2 A -> 3 A, 1")
    >>> told = simulate(explosion, "ssa", {"A": 9}, [0.01, 5.0], runs=20, seed=1).truncated
    >>> told.until, told.beyond, told.channel, told.share
    (0.01, 5.0, 'r1', 1.0)
    """

    time: float
    run: int
    truncated: int
    among: int
    until: float | None
    beyond: float
    end: float
    channel: str
    propensity: float
    reason: str
    events: float
    max_events: int
    time_unit: str = ""

    @property
    def share(self) -> float:
        """Share of runs that did not reach `beyond`."""
        return self.truncated / self.among

    @property
    def cause(self) -> str:
        """Why, and which channel had the largest propensity."""
        per = f"1/{self.time_unit}" if self.time_unit else ""
        why = REASONS[self.reason].format(events=self.events, most=self.max_events, end=self.end)
        grown = f"; channel {self.channel!r} had the largest propensity, {in_unit(f'{self.propensity:.3g}', per)}"
        return why + (grown if self.channel else "")

    def __str__(self) -> str:
        """A note beside figures."""
        last = "" if self.until is None else f"figures end at {in_unit(f'{self.until:g}', self.time_unit)}: "
        return (
            f"{last}run {self.run} was truncated at {self._when}: {self.cause}; {self.truncated} of the first "
            f"{self.among} runs did not reach {self.beyond:g}"
        )

    @property
    def _when(self) -> str:
        return in_unit(f"{self.time:.4g}", self.time_unit)

    @property
    def refusal(self) -> str:
        """The error message if no figures can be given."""
        more = ", or raise max_events" if self.reason in ("events", "forecast") else ""
        return (
            f"run {self.run}: {self.cause}; it was truncated at {self._when}, before {self.beyond:g}: ask for earlier "
            f"times, or lower the rate constants{more}"
        )

    def to_dict(self) -> dict[str, Any]:
        """All of it, with the share."""
        return asdict(self) | {"share": self.share}


class TruncatedRunsError(ValueError):
    """Runs were truncated before a time that is needed.

    >>> from kinetics import Network, simulate
    >>> from kinetics.runs import TruncatedRunsError
    >>> try:
    ...     simulate(Network.from_text("2 A -> 3 A, 1"), "ssa", {"A": 9}, [5.0], runs=2, seed=1)
    ... except TruncatedRunsError as error:
    ...     print(error.truncation.channel)
    r1
    """

    def __init__(self, truncation: Truncation) -> None:
        super().__init__(truncation.refusal)
        self.truncation = truncation
