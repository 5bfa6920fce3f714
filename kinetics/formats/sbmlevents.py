"""The events of SBML files."""

from __future__ import annotations

from typing import Any

from kinetics.formats.sbmlnames import SbmlNames
from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression


def events_of(names: SbmlNames) -> list[Event]:
    """All events that can happen and change something; one without its trigger never does."""
    made = [_event(names, event, place) for place, event in enumerate(names.each("Events"), 1)]
    return [event for event in made if event is not None]


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
        text, size = names.text(change, change.getMath()), names.size(species)
        assign[species] = names.expression(change, text if size in ("1", "1.0") else f"({text}) * {size}")
    when = names.expression(trigger, names.text(trigger, trigger.getMath()))
    if not when.is_condition:  # a number, which Level 3 Version 2 takes for one
        when = names.expression(trigger, f"({when.text}) != 0")
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
    given = event.getPriority()
    if given is None or not given.isSetMath():
        return 0.0
    value = names.constant(given, names.text(given, given.getMath()))
    if value is None:
        raise names.wrong(event, f"event {name!r} has a priority that is no number")
    return value


def _delay(names: SbmlNames, event: Any) -> Expression:
    given = event.getDelay()
    is_given = given is not None and given.isSetMath()
    return names.expression(event, names.text(given, given.getMath()) if is_given else "0")
