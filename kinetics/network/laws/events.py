"""Events: assignments to counts when a condition becomes true, such as a dose at a given time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

from kinetics.network.laws.expression import Expression
from kinetics.support.frozen import set_fields


@dataclass(frozen=True)
class Event:
    """An instantaneous, deterministic assignment to counts, made each time a condition turns from false to true.

    With a delay it is made so much later; a condition may then turn true again before, and each time counts.

    name : name of the event
    when : the condition over counts, parameters and t: "t >= 50", "S < 10 and P > 0"
    assign : species -> its new count, an expression over the counts just before; it must come out whole and >= 0
    parameters : name -> value, for both; a parsed expression brings its own
    priority : of events at the same moment the highest comes first, then the first listed
    was_true : the condition's value before time 0; where it was true already, the event waits for the next time
    from_trigger : the new counts follow from those at the moment the condition turned true, not from those of the
        moment at which they are set, which other events or the delay may have changed
    delay : time from the moment the condition turned true, tu, a number of at least 0 or an expression over the counts
        at that moment
    persistent : an event that is due happens even if its condition has become false again; if not, it is dropped

    These are the events of SBML Level 3: initialValue, useValuesFromTriggerTime, delay, persistent.

    >>> from dataclasses import replace
    >>> from kinetics import Network, simulate
    >>> from kinetics.network.laws import Event
    >>> decay = replace(Network.from_text("A -> 0, 10"), events=[Event("dose", "t >= 5", {"A": "A + 100"})])
    >>> simulate(decay, "general", {"A": 3}, [4.9, 5.0, 9.0], runs=1, seed=1)["A"].tolist()
    [[0, 100, 0]]
    """

    name: str
    when: str | Expression
    assign: Mapping[str, str | float | Expression]
    parameters: Mapping[str, float] = field(default_factory=dict)
    priority: float = 0.0
    was_true: bool = True
    from_trigger: bool = False
    delay: str | float | Expression = 0.0
    persistent: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"{self.name!r} is no name of an event; expected text")
        if not isinstance(self.assign, Mapping):
            raise ValueError(f"event {self.name!r} assigns {self.assign!r}; expected {{species: new count}}")
        if not self.assign:
            raise ValueError(f"event {self.name!r} changes nothing; give it new counts, such as {{'S': 'S + 10'}}")
        if not math.isfinite(self.priority):
            raise ValueError(f"event {self.name!r} has priority {self.priority}; expected a finite number")
        when, assign = self._parsed(self.when), {name: self._parsed(value) for name, value in self.assign.items()}
        set_fields(self, when=when, assign=assign, delay=self._parsed(self.delay))
        if not self.condition.is_condition:
            came = self.condition.text
            raise ValueError(f"event {self.name!r}: {came!r} is no condition; expected one such as 't >= 50'")

    @classmethod
    def every(
        cls,
        period: float,
        assign: Mapping[str, str | float | Expression],
        start: float | None = None,
        name: str = "dose",
        **rest: object,
    ) -> Event:
        """An event at `start`, by default after one period, and again after each further `period`, tu.

        Its times are right to the rounding of the clock.
        """
        first = float(period if start is None else start)
        if not (math.isfinite(period) and period > 0 and math.isfinite(first) and first >= 0):
            raise ValueError(f"event {name!r}: every {period} tu from {first}; expected a time above 0, from >= 0")
        period = float(period)
        since = f"(t - {first!r})" if first else "t"
        when = f"t >= {first!r} and {since} / {period!r} % 1 < 0.5"
        return cls(name, when, assign, was_true=False, **rest)  # type: ignore[arg-type]

    @property
    def condition(self) -> Expression:
        """The condition, parsed."""
        return cast(Expression, self.when)

    @property
    def waits(self) -> Expression:
        """The delay, parsed."""
        return cast(Expression, self.delay)

    @property
    def is_delayed(self) -> bool:
        """Whether it has a delay other than 0."""
        return self.waits.text not in ("0", "0.0")

    @property
    def new_counts(self) -> dict[str, Expression]:
        """Species -> its new count, parsed."""
        return cast(dict[str, Expression], self.assign)

    def with_parameters(self, values: Mapping[str, float]) -> Event:
        """A copy with new values for the named parameters; the others keep theirs."""
        new = {name: value.with_parameters(values) for name, value in self.new_counts.items()}
        when, delay = self.condition.with_parameters(values), self.waits.with_parameters(values)
        return replace(self, when=when, assign=new, delay=delay)

    def check_names(self, species: Mapping[str, int]) -> None:
        """ValueError if it names a species or parameter that does not exist."""
        self.condition.check_names(f"event {self.name!r}", species)
        self.waits.check_names(f"event {self.name!r}", species)
        for name, value in self.new_counts.items():
            if name not in species:
                raise ValueError(f"event {self.name!r} sets {name!r}; the species are {', '.join(species)}")
            value.check_names(f"event {self.name!r}", species)

    def __str__(self) -> str:
        sets = ", ".join(f"{name} = {value}" for name, value in self.new_counts.items())
        rank = f", priority {self.priority:g}" if self.priority else ""
        later = f", {self.waits} tu later" if self.is_delayed else ""
        return f"{self.name}: when {self.condition}{later}: {sets}{rank}"

    def _parsed(self, given: str | float | Expression) -> Expression:
        if isinstance(given, Expression):
            return given
        try:
            return Expression(given if isinstance(given, str) else repr(float(given)), self.parameters)
        except (ValueError, TypeError) as error:
            raise ValueError(f"event {self.name!r}: {error}") from None


def checked_events(events: Sequence[Event], species: Mapping[str, int]) -> tuple[Event, ...]:
    """Events with different names, in terms of species that exist."""
    checked = tuple(events)
    if not all(isinstance(event, Event) for event in checked):
        raise ValueError(f"events are {checked!r}; expected a sequence of kinetics.network.laws.Event")
    seen: set[str] = set()
    for event in checked:
        if event.name in seen:
            raise ValueError(f"events has {event.name!r} twice; names must be unique")
        seen.add(event.name)
        event.check_names(species)
    return checked
