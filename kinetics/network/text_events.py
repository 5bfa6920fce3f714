"""Events in a text of reactions: `at t = 20: A = A + 100` and `when B > 30: A = 0, B = B - 10`.

Behind the time or the condition, after commas, may stand what `Event` has: `delay 5`, `priority 2`, `from trigger`,
`not persistent`, and, after a condition, `also at 0`, if one that is true at time 0 counts as having turned true.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code, Graph
from kinetics.network.laws.program import known_numbers
from kinetics.network.laws.reading import TIME
from kinetics.network.laws.writing import quoted
from kinetics.network.parameters import CLOSE, meant
from kinetics.network.source_spans import Mark, SourceSpan
from kinetics.network.text_formulas import TextFormulas
from kinetics.network.text_names import name_in

OPENING = re.compile(r"\s*(at|when)\b\s*(?=[\w'\"(.-])")
FORMS = "expected an event such as 'at t = 20: A = A + 100' or 'when B > 30: A = 0, B = B - 10'"
FLAGS = {"from trigger": ("from_trigger", True), "not persistent": ("persistent", False)}
ALSO_AT_0 = "also at 0"
NUMBERS = ("delay", "priority")
UNNAMED = "event {}"  # name of the event in that place, if it has no other


class EventLine(NamedTuple):
    """A line that is an event.

    name : of the event
    is_at : whether it states a time, not a condition
    moment : the time or the condition
    options : what stands behind it
    sets : species -> its name in the line, and its new count
    """

    name: str
    is_at: bool
    moment: SourceSpan
    options: list[SourceSpan]
    sets: dict[str, tuple[SourceSpan, SourceSpan]]


def opens_event(text: str, begin: int, marks: Sequence[Mark]) -> bool:
    """Whether an event begins at this place of a line: `at` or `when` with something behind it that is no sign."""
    found = OPENING.match(text, begin)
    return found is not None and all(mark.start != found.end() for mark in marks)


def event_line(name: str, line: SourceSpan, begin: int, marks: Sequence[Mark]) -> EventLine:
    """The parts of an event, which begins at a place of its line. ValueError, with line and column, for others."""
    opening = OPENING.match(line.text, begin)
    assert opening is not None, "asked before"  # noqa: S101
    colon = next((mark for mark in marks if mark.sign == ":"), None)
    if colon is None:
        raise line.wrong(f"no colon behind {opening[1]!r}; {FORMS}", len(line.text.rstrip()))
    head = line.part(opening.end(), colon.start)
    moment, *options = head.between([mark for mark in head.divided()[1] if mark.sign == ","])
    equals = [mark for mark in marks if mark.sign == "="]
    if opening[1] == "at":
        moment = _time_in(moment)
    elif any(mark.start < colon.start for mark in equals):
        mark = equals[0]
        raise line.wrong("= gives a value; write == to compare", mark.start)
    sets: dict[str, tuple[SourceSpan, SourceSpan]] = {}
    ends = [colon, *(mark for mark in marks if mark.sign == "," and mark.start > colon.start)]
    for part in line.between(ends)[1:]:
        _, inner = part.divided()
        if [mark.sign for mark in inner] != ["="]:
            raise part.wrong(f"{part.text!r} came where a new count was expected, such as 'A = A + 100'")
        target = part.part(0, inner[0].start)
        species = name_in(target, "a species")
        if species in sets:
            raise target.wrong(f"{species!r} has two new counts in one event; expected one")
        sets[species] = target, part.part(inner[0].end)
    return EventLine(name, opening[1] == "at", moment, options, sets)


def _time_in(moment: SourceSpan) -> SourceSpan:
    """What stands behind `t =`."""
    _, marks = moment.divided()
    if len(marks) != 1 or marks[0].sign != "=" or moment.text[: marks[0].start].strip() != TIME:
        raise moment.wrong(f"{moment.text!r} came where 't = ...' was expected; {FORMS}")
    return moment.part(marks[0].end)


def event_of(line: EventLine, formulas: TextFormulas, constants: Collection[str] = ()) -> Event:
    """The event of a line, once all names are known. ValueError, with line and column, if it cannot be.

    constants : species that nothing may change
    """
    moment = line.moment
    if line.is_at:
        time = formulas.timed(moment, only_parameters=True)
        value = formulas.number(moment, "the time of the event", time)
        if value < 0:
            raise moment.wrong(f"the time of the event is {value:g}; expected at least 0")
        graph = formulas.graph
        place = graph.add(Code.LESS_EQUAL, (graph.copied(time.formula)[-1], graph.time()))
        when = moment.located(lambda: formulas.expression(place))
    else:
        when = formulas.read(moment)
    given: dict[str, Any] = {"was_true": False} if line.is_at else {}
    for option in line.options:
        _read_option(option, line.is_at, formulas, given)
    assign: dict[str, str | float | Expression] = {}
    for name, (target, formula) in line.sets.items():
        if name not in formulas.species or name in constants:
            raise target.wrong(_no_count(name, formulas, constants))
        assign[name] = formulas.counted(formula)
    return moment.located(lambda: Event(line.name, when, assign, **given))


def _no_count(name: str, formulas: TextFormulas, constants: Collection[str]) -> str:
    if name in constants:
        return f"{name!r} is held constant; leave out this assignment, or the line that holds it"
    if name in formulas.values:
        return f"{name!r} is a parameter, which stays as it is; events set counts of species"
    return f"unknown species {name!r}{meant(name, [*formulas.species])}; events set counts of species"


def _read_option(option: SourceSpan, is_at: bool, formulas: TextFormulas, given: dict[str, Any]) -> None:
    """One of the words behind the moment of an event."""
    text = " ".join(option.text.split())
    word = text.partition(" ")[0]
    key: str = word
    value: Any = None
    if text in FLAGS:
        key, value = FLAGS[text]
    elif text == ALSO_AT_0 and not is_at:
        key, value = "was_true", False
    elif word == "priority":
        rest = option.part(len(word))
        value = formulas.number(rest, "the priority", formulas.read(rest, only_parameters=True)) + 0.0  # no -0
    elif word == "delay":
        value = _delay(option.part(len(word)), formulas)
    elif value is None:
        some = ", ".join([*(f"{each} ..." for each in NUMBERS), *FLAGS, *([] if is_at else [ALSO_AT_0])])
        raise option.wrong(f"{option.text!r} came behind the moment of an event; expected one of {some}")
    if key in given:
        raise option.wrong(f"{text!r} comes twice, or contradicts what stands before it; leave it out")
    given[key] = value


def _delay(span: SourceSpan, formulas: TextFormulas) -> Expression:
    delay = formulas.timed(span)
    if not delay.species and not delay.reads_time:
        value = formulas.number(span, "the delay", delay)
        if value < 0:
            raise span.wrong(f"the delay is {value:g}; expected at least 0")
    return delay


def check_new_counts(events: Mapping[str, EventLine], made: Sequence[Event]) -> None:
    """A ValueError, with line and column, for a new count that is no whole number of at least 0 whatever the state.

    One that follows from counts is judged when the event happens: a run that sets half a copy ends with an error.
    """
    for event in made:
        for species, formula in event.new_counts.items():
            if formula.species or formula.reads_time:
                continue
            value = known_numbers(formula)[-1]
            if value is None or not 0 <= value < 2.0**63 or abs(value - round(value)) > CLOSE * value:
                came = f"{formula.text}{'' if value is None else f' = {value:g}'}"
                raise (
                    events[event.name]
                    .sets[species][1]
                    .wrong(f"{came} copies of {species!r}; expected a whole number of at least 0")
                )


def event_text(event: Event, text: Callable[[Expression], str]) -> str:
    """An event without its name, as `event_of` reads it.

    text : what spells a formula
    """
    time = time_of(event)
    options = [f"delay {text(event.waits)}"] if event.is_delayed else []
    options += [f"priority {event.priority!r}"] if event.priority else []
    options += [words for words, (key, value) in FLAGS.items() if getattr(event, key) == value]
    options += [ALSO_AT_0] if time is None and not event.was_true else []
    moment = f"when {text(event.condition)}" if time is None else f"at {TIME} = {text(time)}"
    sets = [f"{quoted(name)} = {text(formula)}" for name, formula in event.new_counts.items()]
    return f"{', '.join([moment, *options])}: {', '.join(sets)}"


def time_of(event: Event) -> Expression | None:
    """The time of an event at a time of its own, a number or a formula of parameters; None for a condition."""
    formula, read = event.condition.formula, event.condition.parameters
    if event.was_true or formula[-1].code != Code.LESS_EQUAL or formula[formula[-1].parts[1]].code != Code.CLOCK:
        return None
    graph = Graph(most=3 * len(formula) + 10)
    time = Expression.of(graph.formula(graph.copied(formula)[formula[-1].parts[0]]), read)
    value = None if time.species or time.reads_time else known_numbers(time)[-1]
    return time if value is not None and value >= 0 else None
