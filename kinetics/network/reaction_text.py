"""Networks as people write them, a line for each reaction, parameter, count at time 0 or setting.

bind: A + B <-> AB, k1, k2   # a label, if there is one; the reaction; a rate for each direction
0 -> A, 5                    # nothing is written 0
AB -> P + B, v * AB / (K + AB)
k1 = 1e-3                    # a parameter: a number, or a formula of parameters above
A = 100                      # a count at time 0, of a name that is a species
time unit: s

A rate that reads counts or the time t is the whole propensity. Any other is a rate constant k, and the propensity is
that of mass action, k times the combinations of the reactants. Names that are no plain words are quoted: 'A-B'.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import MOST_NODES, Code, Graph
from kinetics.network.laws.reading import FUNCTIONS, LONGEST, NUMBER, Token, node_of, tokens_of
from kinetics.network.laws.writing import quoted
from kinetics.network.parameters import Parameters, meant, number_of
from kinetics.network.propensity import COMBINATIONS
from kinetics.network.reactions import Reaction
from kinetics.network.source_spans import QUOTED, Mark, SourceSpan
from kinetics.support.limits import check_visible

MOST_COPIES = 10**6  # in one place of a reaction
MOST_REACTIONS = 10**6  # of a text
BACKWARD = "{} backward"  # name of the second direction's channel
SETTINGS = ("time unit", "species", "combinations", "observable")
SETTING = re.compile(rf"\s*({'|'.join(SETTINGS)})\s*:")
ADDEND = re.compile(rf"\s*(?:[0-9.]+\s*\*?\s*)?(?:[^\W\d]\w*|{QUOTED})\s*(\+)?")
UNITS = ("s", "ms", "min", "h", "d", "M", "mM", "uM", "nM", "mol", "tu")  # that often stand behind a number
ELSEWHERE = {  # what others write
    **dict.fromkeys(("if", "then", "else"), " (a choice is written piecewise(value, condition, otherwise))"),
    **dict.fromkeys(("time", "Time", "TIME"), " (the time is t)"),
}
COUNT = re.compile("[0-9]{1,19}")


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
        self.text, self.chosen = text, chosen
        self.graph = Graph(MOST_NODES + len(text))
        self.made = ReactionText()
        self.species: dict[str, None] = {}
        self.reactions: list[tuple[str, Reaction, SourceSpan]] = []
        self.labels: set[str] = set()
        self.assigned = self.made.written
        self.observables: dict[str, SourceSpan] = {}
        self.settings: dict[str, str] = {}
        self.used: set[str] = set()

    def whole(self) -> ReactionText:
        for number, line in enumerate(self.text.splitlines(), 1):
            self._read(SourceSpan(number, line, 0, line))
        if not self.species:
            what = "no reaction has a species" if self.reactions else "no reaction came"
            raise ValueError(f"{what}; expected lines such as 'A + B -> AB, 1e-3'")
        self.made.species, self.made.reactions = list(self.species), {name: pair for name, pair, _ in self.reactions}
        self._read_parameters()
        for name, _, rate in self.reactions:
            self._read_rate(name, rate)
        for name, span in self.observables.items():
            self.made.observables[name] = self._formula(span)
        self._check_used()
        return self.made

    def _check_used(self) -> None:
        """What nothing reads is most likely a slip of the pen."""
        for name in (*self.chosen, *self.assigned):
            if name not in self.used and name not in self.species:
                fault = f"{name!r} is neither a species nor in any formula{meant(name, [*self.species, *self.used])}"
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
        if marks and marks[0].sign == ":":
            name = line.part(0, marks[0].start)
            label, begin = self._name(name, f"a reaction's name{meant(name.text, SETTINGS)}"), marks[0].end
            marks = marks[1:]
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
                name = self._name(part, "a species")
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
            self.made.time_unit = given.text
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
        return self._name(given.part(0, marks[0].start), "an observable"), given.part(marks[0].end)

    def _assign(self, name: SourceSpan, formula: SourceSpan) -> None:
        key = self._name(name, "a parameter or a species")
        if key in self.assigned:
            raise name.wrong(f"{key!r} has a value in line {self.assigned[key].number} already; expected one")
        if not formula.text:
            raise formula.wrong(f"{key!r} has no value; expected a number or a formula of parameters")
        self.assigned[key] = formula

    def _name(self, span: SourceSpan, what: str) -> str:
        tokens = span.located(lambda: list(tokens_of(span.text)))
        if len(tokens) != 1:
            raise span.wrong(f"{span.text!r} came where {what} was expected: one word, or any text in quotes")
        return self._named(span, tokens[0])

    def _named(self, span: SourceSpan, token: Token) -> str:
        """The name that a word or a quoted text of a span stands for."""
        if token.kind == "word":
            if quoted(token.text) != token.text:
                fault = f"{token.text!r} is reserved in formulas; quote it if it is a name"
                raise span.wrong(fault, token.column)
            return token.text
        if token.kind != "quoted":
            fault = f"{token.text!r} came where a name was expected: one word, or any text in quotes"
            raise span.wrong(fault, token.column)
        names: list[str] = []
        here = span.part(token.column, token.column + len(token.text))
        here.located(lambda: node_of(here.text, Graph(), lambda name: names.append(name) or 0))  # type: ignore[func-returns-value]
        here.located(lambda: check_visible("a name", names[0]))
        return names[0]

    def _react(self, label: str, line: SourceSpan, begin: int, arrow: Mark, commas: list[Mark]) -> None:
        if arrow.sign not in ("->", "<->"):
            raise line.wrong(f"the arrow {arrow.sign!r}; expected -> or <->", arrow.start)
        is_two_way = arrow.sign == "<->"
        ends = [mark for mark in commas if mark.start > arrow.start]
        _, after, *rates = line.between([arrow, *ends])
        before = self._side(line.part(begin, arrow.start), "before")
        made = self._side(after, "after")
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

    def _side(self, side: SourceSpan, where: str) -> dict[str, int]:
        """Copies of each species on one side of a reaction."""
        if side.text in ("0", "∅"):
            return {}
        copies: dict[str, int] = {}
        tokens = [*side.located(lambda: list(tokens_of(side.text))), Token("end", "", len(side.text))]
        i = 0
        while True:
            n = 1
            if tokens[i].kind == "number":
                n = self._copies(side, tokens[i])
                i += 1 + (tokens[i + 1].text == "*")
            token = tokens[i]
            if token.kind not in ("word", "quoted"):
                came = f"{token.text!r} came" if token.text else "nothing came"
                fault = f"{came} where a species {where} the arrow was expected; nothing is written 0"
                raise side.wrong(fault, token.column)
            name = self._named(side, token)
            self.species.setdefault(name)
            copies[name] = copies.get(name, 0) + n
            token, i = tokens[i + 1], i + 2
            if token.kind == "end":
                return copies
            if token.text != "+":
                raise side.wrong(
                    f"{token.text!r} came after {name!r}, {where} the arrow; expected + and a species"
                    + (", or a comma and the rate" if where == "after" else ", or the arrow"),
                    token.column,
                )

    def _copies(self, side: SourceSpan, token: Token) -> int:
        value = float(token.text)
        if not value.is_integer() or not 1 <= value <= MOST_COPIES:
            expected = f"expected a whole number from 1 to {MOST_COPIES}, or 0 alone for nothing"
            raise side.wrong(f"{token.text} copies; {expected}", token.column)
        return int(value)

    # Their formulas

    def _read_parameters(self) -> None:
        for name in self.chosen:
            if name in self.species:
                raise ValueError(f"{name!r} is a species; its count at time 0 is written as a line, '{name} = 100'")
        given: dict[str, float | Expression] = {n: v for n, v in self.chosen.items() if n not in self.assigned}
        initial: dict[str, int | Expression] = {}
        values = {name: number_of(f"parameter {name!r}", value, {}) for name, value in self.chosen.items()}
        known = {name: values[name] for name in given}
        for name, span in self.assigned.items():
            if name not in self.species:
                formula = self._formula(span, known)
                known[name] = self._number(span, f"parameter {name!r}", values.get(name, formula), known)
                given[name] = formula if formula.parameters and name not in values else known[name]
        self.made.parameters = Parameters(given)
        for name, span in self.assigned.items():
            if name in self.species:
                is_plain = COUNT.fullmatch(span.text)
                initial[name] = int(span.text) if is_plain else self._formula(span, known)
                if self._number(span, f"the count of {name!r}", initial[name], {}) < 0:
                    raise span.wrong(f"{span.text} copies of {name!r}; expected at least 0")
        self.made.parameters = Parameters(given, {}, initial)

    def _read_rate(self, name: str, span: SourceSpan) -> None:
        rate = float(span.text) if re.fullmatch(NUMBER, span.text) else self._formula(span)
        if isinstance(rate, Expression) and (rate.reads_time or rate.species):  # all but parameters are species
            self.made.laws[name] = rate
            return
        self.made.rates[name] = rate
        value = self._number(span, "the rate", rate, {})
        if value < 0:
            raise span.wrong(f"the rate is {value:g}; expected at least 0")

    def _formula(self, span: SourceSpan, known: Mapping[str, float] | None = None) -> Expression:
        """A formula with the values of its parameters; without counts where only `known` parameters may be read."""
        values = self.made.parameters.values if known is None else known

        def named(name: str) -> int:
            if name in values:
                self.used.add(name)
            elif known is not None and name in (*self.species, *self.assigned):
                where = "a species" if name in self.species else f"given in line {self.assigned[name].number}, below"
                raise ValueError(f"{name!r} is {where}; expected parameters that are given above")
            elif name not in self.species:
                raise ValueError(f"unknown name {name!r}{self._cure(name, values)}")
            return self.graph.name(name)

        def read() -> Expression:
            place = node_of(span.text, self.graph, named)
            formula = self.graph.formula(place)
            used = [str(node.value) for node in formula if node.code == Code.COUNT]
            return Expression.of(formula, {name: values[name] for name in used if name in values})

        return span.located(read)

    def _cure(self, name: str, values: Mapping[str, float]) -> str:
        """What to do about a name that is not known."""
        if name in FUNCTIONS:
            return f" (the function wants its arguments, as in {name}(...))"
        if name in ELSEWHERE:
            return ELSEWHERE[name]
        units = " (numbers have no units here)" if name in UNITS else ""
        return (
            meant(name, [*values, *self.species]) or units or f"; give it a value, as by a line '{quoted(name)} = 1e-3'"
        )

    def _number(self, span: SourceSpan, what: str, given: float | Expression, values: Mapping[str, float]) -> float:
        return span.located(lambda: number_of(what, given, values))


def _behind_the_sum(text: str, begin: int) -> int:
    """Where an arrow was to be expected: behind the first name that no + follows."""
    found = ADDEND.match(text, begin)
    while found and found[1]:
        begin = found.end()
        found = ADDEND.match(text, begin)
    return min(found.end() if found else begin, len(text))
