"""The events of SBML files."""

from __future__ import annotations

from itertools import combinations
from typing import Any

from kinetics.formats.sbmlnames import SbmlNames
from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import TRUTHS, Code


def events_of(names: SbmlNames) -> list[Event]:
    """All events that can happen and change something; one without its trigger never does."""
    made = [(event, _event(names, event, place)) for place, event in enumerate(names.each("Events"), 1)]
    events = [event for _, event in made if event is not None]
    ranked = [each for source, each in made if each is not None and _has_priority(source)]
    for one, other in combinations(ranked, 2):
        if one.priority == other.priority and (_touches(one, other) or _touches(other, one)):
            raise names.wrong(
                names.source,
                f"events {one.name!r} and {other.name!r} have the same priority, which means a random order if they "
                f"coincide; that is not supported, give them different ones",
            )
    return events


def _touches(one: Event, other: Event) -> bool:
    """Whether an event sets a variable that the other one reads or sets."""
    formulas = (other.condition, other.waits, *other.new_counts.values())
    read = {name for formula in formulas for name in formula.species}
    return not one.new_counts.keys().isdisjoint(read | other.new_counts.keys())


def _has_priority(event: Any) -> bool:
    return event.getPriority() is not None and event.getPriority().isSetMath()


def _event(names: SbmlNames, event: Any, place: int) -> Event | None:
    name, trigger = event.getId() or f"event {place}", event.getTrigger()
    changes = [event.getEventAssignment(i) for i in range(event.getNumEventAssignments())]
    changes = [change for change in changes if change.isSetMath()]
    if trigger is None or not trigger.isSetMath() or not changes:
        return None
    assign: dict[str, str | float | Expression] = {}
    for change in changes:
        species = change.getVariable()
        if species not in names.states:
            raise names.wrong(change, f"event {name!r} sets {species!r}; only counts of species can be set")
        value, size = names.node(change, change.getMath()), names.size(species)
        if event.isSetDelay() and event.getUseValuesFromTriggerTime() and names.constant(size) is None:
            raise names.wrong(
                change, f"event {name!r} sets the concentration of {species!r} later, in a changing volume"
            )
        if not names.graph.is_known(size, 1.0):
            value = names.graph.add(Code.MULTIPLY, (value, size))
        assign[species] = names.expression(value)
    condition = names.node(trigger, trigger.getMath())
    if names.graph.nodes[condition].code not in TRUTHS:  # a number, which Level 3 Version 2 takes for one
        condition = names.graph.add(Code.NOT_EQUAL, (condition, names.graph.number(0.0)))
    when = names.expression(condition)
    return Event(
        name,
        when,
        assign,
        priority=_priority(names, event, name),
        was_true=not trigger.isSetInitialValue() or trigger.getInitialValue(),
        from_trigger=event.getUseValuesFromTriggerTime(),
        delay=_delay(names, event),
        persistent=not trigger.isSetPersistent() or trigger.getPersistent(),
    )


def _priority(names: SbmlNames, event: Any, name: str) -> float:
    if not _has_priority(event):
        return 0.0
    given = event.getPriority()
    value = names.constant(names.node(given, given.getMath()))
    if value is None:
        raise names.wrong(event, f"event {name!r} has a priority that is no number")
    return value


def _delay(names: SbmlNames, event: Any) -> Expression:
    given = event.getDelay()
    is_given = given is not None and given.isSetMath()
    return names.expression(names.node(given, given.getMath()) if is_given else names.graph.number(0.0))
