"""Networks as people write them, a line for each reaction, parameter, count at time 0 or setting.

bind: A + B <-> AB, k1, k2   # a label, if there is one; the reaction; a rate for each direction
0 -> A, 5                    # nothing is written 0
AB -> P + B, v * AB / (K + AB)
k1 = 1e-3                    # a parameter: a number, or a formula of parameters above
A = 100                      # a count at time 0, of a name that is a species
const S = 100                # a species that reactions neither take nor make
at t = 20: A = A + 100       # an event; or when B > 30: A = 0, B = B - 10
for i in 1..5: A[i] -> A[i+1], k   # repeated, with A_1, A_2, ...
volume = 1 fL                # for units: k1 = 1e6 /M/s, A = 5 nM; see `units`
time unit: s

A rate that reads counts or the time t is the whole propensity. Any other is a rate constant k, and the propensity is
that of mass action, k times the combinations of the reactants. Names that are no plain words are quoted: 'A-B'.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.reading import LONGEST, NUMBER
from kinetics.network.parameters import Parameters, meant
from kinetics.network.propensity import COMBINATIONS
from kinetics.network.reactions import Reaction
from kinetics.network.source_spans import QUOTED, Mark, SourceSpan
from kinetics.network.text_events import UNNAMED, EventLine, check_new_counts, event_line, event_of, opens_event
from kinetics.network.text_formulas import TextFormulas
from kinetics.network.text_names import name_in, side_in
from kinetics.network.text_repeats import expanded
from kinetics.network.text_values import is_law, read_parameters, read_rate

MOST_REACTIONS = 10**6  # of a text
BACKWARD = "{} backward"  # name of the second direction's channel
SETTINGS = ("time unit", "species", "combinations", "observable")
SETTING = re.compile(rf"\s*({'|'.join(SETTINGS)})\s*:")
ADDEND = re.compile(rf"\s*(?:[0-9.]+\s*\*?\s*)?(?:[^\W\d]\w*|{QUOTED})\s*(\+)?")
VOLUME = "volume"
VOLUME_TEXT = re.compile(rf"\s*(?>{NUMBER})\s*[^\W\d]")  # a number and a unit; any other value makes it a parameter
CONSTANT = re.compile(r"\s*const\s+(?=[\w'\"])")


@dataclass
class ReactionText:
    """What a text says, once it is read.

    species : in the order in which they are first named
    reactions : channel -> its two sides
    rates : channel -> its rate constant, of mass action
    laws : channel -> its whole propensity
    parameters : with counts at time 0
    observables : name -> formula over counts
    time_unit, combinations : as `Network` has them
    written : parameter, or species with a count at time 0 -> where its value stands
    events : in the order of the text
    event_lines : name of each -> its line
    notes : the volume, and what was rounded
    """

    species: list[str] = field(default_factory=list)
    reactions: dict[str, Reaction] = field(default_factory=dict)
    rates: dict[str, float | Expression] = field(default_factory=dict)
    laws: dict[str, Expression] = field(default_factory=dict)
    parameters: Parameters = field(default_factory=Parameters)
    observables: dict[str, Expression] = field(default_factory=dict)
    time_unit: str = ""
    combinations: str = "distinct"
    written: dict[str, SourceSpan] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    event_lines: dict[str, EventLine] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def constants(self) -> list[float]:
        """Rate constants in the order of the channels, 1 if there is a formula or a law."""
        rates = [self.rates.get(name, 1.0) for name in self.reactions]
        return [1.0 if isinstance(rate, Expression) else rate for rate in rates]

    @property
    def given(self) -> Parameters:
        """The parameters, with the rate constants that are formulas of them."""
        formulas = {name: rate for name, rate in self.rates.items() if isinstance(rate, Expression)}
        return replace(self.parameters, rates=formulas)

    def check_counts(self) -> None:
        """A ValueError, with the line, for a count at time 0 that is no whole number of copies."""
        for name in self.parameters.initial:
            self.written[name].located(lambda name=name: self.parameters.count(name))  # type: ignore[misc]
        self.check_events()

    def check_events(self) -> None:
        """A ValueError, with the line, for an event that always sets a count to no whole number of copies."""
        check_new_counts(self.event_lines, self.events)


def read_reactions(text: str, parameters: Mapping[str, float] | None = None) -> ReactionText:
    """The network that a text describes.

    parameters : values of parameters, which go before those that the text itself gives
    A ValueError with line and column, what came and what was expected, for what is no such text. The work is in
    proportion to the text, and its formulas have a budget (see `laws.graph`).
    """
    if not isinstance(text, str):
        raise ValueError(f"{text!r} is no text of reactions; expected lines such as 'A + B -> AB, 1e-3'")
    return _TextReading(text, dict(parameters or {})).whole()


class _TextReading:
    """One text while it is read: first the lines, then, when all names are known, their formulas."""

    def __init__(self, text: str, chosen: dict[str, float]):
        self.lines, self.chosen = expanded(text), chosen
        self.made = ReactionText()
        self.species: dict[str, None] = {}
        self.reactions: list[tuple[str, Reaction, SourceSpan]] = []
        self.labels: set[str] = set()
        self.assigned = self.made.written
        self.observables: dict[str, SourceSpan] = {}
        self.settings: dict[str, str] = {}
        length = sum(len(line.text) for line in self.lines)
        self.formulas = TextFormulas(length, self.species, self.assigned)
        self.constants: dict[str, SourceSpan] = {}
        self.events: dict[str, EventLine] = self.made.event_lines

    def whole(self) -> ReactionText:
        for line in self.lines:
            self._read(line)
        if not self.species:
            what = "no reaction has a species" if self.reactions else "no reaction came"
            raise ValueError(f"{what}; expected lines such as 'A + B -> AB, 1e-3'")
        self._check_constants()
        self.made.species = list(self.species)
        self.made.reactions = {name: self._held(pair) for name, pair, _ in self.reactions}
        self.made.parameters = read_parameters(self.formulas, self.chosen)
        for name, (reactants, _), rate in self.reactions:
            found = read_rate(self.formulas, rate, reactants, self.made.combinations)
            if isinstance(found, Expression) and is_law(found):
                self.made.laws[name] = found
            else:
                self.made.rates[name] = found
        for name, span in self.observables.items():
            self.made.observables[name] = self.formulas.read(span)
        self.made.events = [event_of(line, self.formulas, self.constants) for line in self.events.values()]
        self._check_used()
        measures = self.formulas.measures
        self.made.time_unit, self.made.notes = measures.time_unit, measures.notes
        return self.made

    def _check_used(self) -> None:
        """What nothing reads is most likely a slip of the pen."""
        for name in (*self.chosen, *self.assigned):
            used = self.formulas.used
            if name not in used and name not in self.species:
                fault = f"{name!r} is neither a species nor in any formula{meant(name, [*self.species, *used])}"
                span = self.assigned.get(name)
                raise ValueError(fault) if span is None else span._replace(start=0).wrong(f"{fault}; leave it out")

    # The lines

    def _read(self, whole: SourceSpan) -> None:
        if len(whole.text) > LONGEST:
            raise whole.wrong(f"{len(whole.text)} characters; a line may have at most {LONGEST}")
        line, marks = whole.divided()
        setting = SETTING.match(line.text)
        if setting and any(mark.sign.endswith(">") for mark in marks):
            raise line.part(0).wrong(f"a reaction cannot be called {setting[1]}; quote that name")
        if setting:
            self._set(setting[1], line.part(setting.end()))
        elif line.text.strip():
            self._read_other(line, marks)

    def _read_other(self, line: SourceSpan, marks: list[Mark]) -> None:
        """A reaction, a parameter or a count."""
        label, begin = "", 0
        if opens_event(line.text, 0, marks):
            self._add_event("", line, 0, marks)
            return
        constant = CONSTANT.match(line.text)
        if constant:
            self._hold(line, constant.end(), marks)
            return
        if marks and marks[0].sign == ":":
            name = line.part(0, marks[0].start)
            label, begin = name_in(name, f"a reaction's name{meant(name.text, SETTINGS)}"), marks[0].end
            marks = marks[1:]
        if begin and opens_event(line.text, begin, marks):
            self._add_event(label, line, begin, marks)
            return
        if marks and marks[0].sign == "=" and not begin:
            self._assign(line.part(0, marks[0].start), line.part(marks[0].end))
            return
        arrows = [mark for mark in marks if mark.sign not in (":", ",", "=")]
        if not arrows:
            raise line.wrong(
                f"no arrow{meant(line.text.partition(':')[0].strip(), SETTINGS)}; expected a reaction such as "
                "'A + B -> AB, k', or a line such as 'k = 1e-3', 'A = 100' or 'time unit: s'",
                _behind_the_sum(line.text, begin),
            )
        self._react(label, line, begin, arrows[0], [mark for mark in marks if mark.sign == ","])

    def _set(self, setting: str, given: SourceSpan) -> None:
        if setting == "species":
            _, marks = given.divided()
            for part in given.between([mark for mark in marks if mark.sign == ","]):
                name = name_in(part, "a species")
                if name in self.species:
                    raise part.wrong(f"species {name!r} comes twice, or after a reaction that names it")
                self.species[name] = None
            return
        if setting == "observable":
            name, formula = self._equation(given)
            if formula is None or name in self.observables:
                fault = f"{given.text!r} came; expected a name that is new, as in 'observable: total = A + 2 * AB'"
                raise given.wrong(fault)
            self.observables[name] = formula
            return
        if setting in self.settings or not given.text:
            fault = f"{setting} {'comes twice' if given.text else 'is empty'}; expected it once, with a value"
            raise given.wrong(fault)
        self.settings[setting] = given.text
        if setting == "time unit":
            self.formulas.measures.state_time(given.text)
            return
        if given.text not in COMBINATIONS:
            some = ", ".join(COMBINATIONS)
            raise given.wrong(
                f"combinations: {given.text!r} came; expected one of {some}{meant(given.text, COMBINATIONS)}"
            )
        self.made.combinations = given.text

    def _equation(self, given: SourceSpan) -> tuple[str, SourceSpan | None]:
        _, marks = given.divided()
        if not marks or marks[0].sign != "=":
            return "", None
        return name_in(given.part(0, marks[0].start), "an observable"), given.part(marks[0].end)

    def _add_event(self, label: str, line: SourceSpan, begin: int, marks: list[Mark]) -> None:
        name = label or UNNAMED.format(len(self.events) + 1)
        if name in self.events:
            raise line.part(0).wrong(f"an event is called {name!r} already; every name must differ")
        self.events[name] = event_line(name, line, begin, marks)

    def _hold(self, line: SourceSpan, begin: int, marks: list[Mark]) -> None:
        """A species held constant, with its count if that follows."""
        end = marks[0].start if marks else None
        name = line.part(begin, end)
        key = name_in(name, "a species")
        if key in self.constants:
            raise name.wrong(f"{key!r} is held constant already; leave out one of the lines")
        if marks and marks[0].sign != "=":
            raise line.wrong(f"{marks[0].sign!r} came; expected one species, as in 'const S = 100'", marks[0].start)
        self.constants[key] = name
        if marks:
            self._assign(name, line.part(marks[0].end))

    def _check_constants(self) -> None:
        for name, span in self.constants.items():
            if name not in self.species:
                raise span.wrong(
                    f"no reaction has {name!r} on a side{meant(name, self.species)}; "
                    "a parameter is constant as it is: leave out const"
                )

    def _held(self, pair: Reaction) -> Reaction:
        """A reaction that leaves the copies of constant species as they are."""
        before, after = pair
        if self.constants.keys().isdisjoint((*before, *after)):
            return pair
        return before, {
            name: copies
            for name in dict.fromkeys((*before, *after))
            if (copies := (before if name in self.constants else after).get(name, 0))
        }

    def _assign(self, name: SourceSpan, formula: SourceSpan) -> None:
        key = name_in(name, "a parameter or a species")
        if key in self.assigned:
            raise name.wrong(f"{key!r} has a value in line {self.assigned[key].number} already; expected one")
        if key == VOLUME and VOLUME_TEXT.match(formula.text):
            self.formulas.measures.set_volume(formula)
            return
        if not formula.text:
            raise formula.wrong(f"{key!r} has no value; expected a number or a formula of parameters")
        self.assigned[key] = formula

    def _react(self, label: str, line: SourceSpan, begin: int, arrow: Mark, commas: list[Mark]) -> None:
        if arrow.sign not in ("->", "<->"):
            raise line.wrong(f"the arrow {arrow.sign!r}; expected -> or <->", arrow.start)
        is_two_way = arrow.sign == "<->"
        ends = [mark for mark in commas if mark.start > arrow.start]
        _, after, *rates = line.between([arrow, *ends])
        before, made = side_in(line.part(begin, arrow.start), "before"), side_in(after, "after")
        self.species.update(dict.fromkeys((*before, *made)))
        form = "two, as in 'A <-> B, k1, k2'" if is_two_way else "one, as in 'A -> B, k'"
        for rate in rates:
            if not rate.text:
                raise rate.wrong(f"nothing came behind a comma, where a rate was expected; expected {form}")
        if len(rates) != 1 + is_two_way:
            n = len(rates)
            both = "; write <-> for both directions" if n == 2 and not is_two_way else ""
            fault = f"{n or 'no'} rate{'s' * (n != 1)} after the products; expected {form}{both}"
            raise line.wrong(fault, len(line.text.rstrip())) if n <= 1 else rates[1 + is_two_way].wrong(fault)
        name = label or self._free_name()
        names = [name, BACKWARD.format(name)][: len(rates)]
        for each, pair, rate in zip(names, [(before, made), (made, before)], rates, strict=False):
            if each in self.labels:
                raise line.part(0).wrong(f"a reaction is called {each!r} already; every name must differ")
            if len(self.labels) == MOST_REACTIONS:
                raise line.wrong(f"more than {MOST_REACTIONS} reactions; that many are read at most")
            self.labels.add(each)
            self.reactions.append((each, pair, rate))

    def _free_name(self) -> str:
        n = len(self.reactions) + 1
        while f"r{n}" in self.labels:
            n += 1
        return f"r{n}"


def _behind_the_sum(text: str, begin: int) -> int:
    """Where an arrow was to be expected: behind the first name that no + follows."""
    found = ADDEND.match(text, begin)
    while found and found[1]:
        begin = found.end()
        found = ADDEND.match(text, begin)
    return min(found.end() if found else begin, len(text))
