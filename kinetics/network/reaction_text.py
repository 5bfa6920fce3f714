"""Networks as people write them, a line for each reaction, parameter, count at time 0 or setting.

bind: A + B <-> AB, k1, k2   # a label, where there is one; the reaction; a rate for each direction
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
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeVar

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import MOST_NODES, Code, Graph
from kinetics.network.laws.reading import LONGEST, NUMBER, Token, node_of, shortened, tokens_of
from kinetics.network.laws.writing import quoted
from kinetics.network.parameters import Parameters, meant, number_of
from kinetics.network.propensity import COMBINATIONS
from kinetics.network.reactions import Reaction

MOST_COPIES = 10**6  # in one place of a reaction
MOST_REACTIONS = 10**6  # of a text
BACKWARD = "{} backward"  # name of the second direction's channel
MARK = re.compile(
    r"(?P<quoted>'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\")|(?P<open>['\"])|(?P<comment>#)"
    r"|(?P<arrow><[-=]+>|[-=]+>|<-+|[→⇌↔])|(?P<compare>[<>=!]=)|(?P<mark>[=:,()])"
)
SETTINGS = ("time unit", "species", "combinations", "observable")
SETTING = re.compile(rf"\s*({'|'.join(SETTINGS)})\s*:")
UNITS = ("s", "ms", "min", "h", "d", "M", "mM", "uM", "nM", "mol", "tu")  # that often stand behind a number
COUNT = re.compile("[0-9]{1,19}")

T = TypeVar("T")


class Mark(NamedTuple):
    """A sign that divides a line, outside of quotes and brackets."""

    sign: str
    start: int
    end: int


class Written(NamedTuple):
    """A formula with the line and the column in which it stands."""

    number: int
    line: str
    text: str


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
    """

    species: list[str] = field(default_factory=list)
    reactions: dict[str, Reaction] = field(default_factory=dict)
    rates: dict[str, float | Expression] = field(default_factory=dict)
    laws: dict[str, Expression] = field(default_factory=dict)
    parameters: Parameters = field(default_factory=Parameters)
    observables: dict[str, Expression] = field(default_factory=dict)
    time_unit: str = ""
    combinations: str = "distinct"

    @property
    def constants(self) -> list[float]:
        """Rate constants in the order of the channels, 1 where there is a formula or a law."""
        rates = [self.rates.get(name, 1.0) for name in self.reactions]
        return [1.0 if isinstance(rate, Expression) else rate for rate in rates]

    @property
    def given(self) -> Parameters:
        """The parameters, with the rate constants that are formulas of them."""
        formulas = {name: rate for name, rate in self.rates.items() if isinstance(rate, Expression)}
        return replace(self.parameters, rates=formulas)


def read_reactions(text: str, parameters: Mapping[str, float] | None = None) -> ReactionText:
    """The network that a text describes.

    parameters : values of parameters, which go before those that the text itself gives
    A ValueError with the line, what came and what was expected, for what is no such text. The work is in proportion to
    the text, and its formulas have a budget (see `laws.graph`).
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
        self.reactions: list[tuple[str, Reaction, Written]] = []
        self.labels: set[str] = set()
        self.assigned: dict[str, Written] = {}
        self.observables: dict[str, Written] = {}
        self.settings: dict[str, str] = {}
        self.used: set[str] = set()
        self.number, self.line = 0, ""

    def whole(self) -> ReactionText:
        for number, line in enumerate(self.text.splitlines(), 1):
            self.number, self.line = number, line
            self._told(Written(number, line, ""), self._read)
        if not self.species:
            raise ValueError("no reaction came; expected lines such as 'A + B -> AB, 1e-3'")
        self.made.species, self.made.reactions = list(self.species), {name: pair for name, pair, _ in self.reactions}
        self._read_parameters()
        for name, _, written in self.reactions:
            self._read_rate(name, written)
        for name, written in self.observables.items():
            self.made.observables[name] = self._formula(written)
        self._check_used()
        return self.made

    def _check_used(self) -> None:
        """What nothing reads is most likely a slip of the pen."""
        for name in (*self.chosen, *self.assigned):
            if name not in self.used and name not in self.species:
                fault = f"{name!r} is neither a species nor in any formula{meant(name, [*self.species, *self.used])}"
                written = self.assigned.get(name)
                raise ValueError(fault) if written is None else self._wrong(written, f"{fault}; leave it out")

    # The lines

    def _read(self) -> None:
        if len(self.line) > LONGEST:
            raise ValueError(f"{len(self.line)} characters; a line may have at most {LONGEST}")
        line, marks = self._divided(self.line)
        setting = SETTING.match(line)
        if setting and any(mark.sign.endswith(">") for mark in marks):
            raise ValueError(f"a reaction cannot be called {setting[1]}; quote that name")
        if setting:
            self._set(setting[1], line[setting.end() :].strip())
        elif line.strip():
            self._read_other(line, marks)

    def _read_other(self, line: str, marks: list[Mark]) -> None:
        """A reaction, a parameter or a count."""
        label, begin = "", 0
        if marks and marks[0].sign == ":":
            what = f"a reaction's name{meant(line[: marks[0].start].strip(), SETTINGS)}"
            label, begin = self._name(line[: marks[0].start], what), marks[0].end
            marks = marks[1:]
        if marks and marks[0].sign == "=" and not begin:
            self._assign(line[: marks[0].start], line[marks[0].end :])
            return
        arrows = [mark for mark in marks if mark.sign not in (":", ",", "=")]
        if not arrows:
            raise ValueError(
                f"no arrow{meant(line.partition(':')[0].strip(), SETTINGS)}; expected a reaction such as "
                f"'A + B -> AB, k', or a line such as 'k = 1e-3', 'A = 100' or 'time unit: s'"
            )
        self._react(label, line, begin, arrows[0], [mark for mark in marks if mark.sign == ","])

    def _divided(self, line: str) -> tuple[str, list[Mark]]:
        """A line without its comment, and its marks."""
        marks: list[Mark] = []
        depth = 0
        for found in MARK.finditer(line):
            kind, sign = found.lastgroup, found[0]
            if kind == "open":
                raise ValueError(f"the quote at column {found.start() + 1} is never closed")
            if kind == "comment":
                return line[: found.start()], marks
            depth += (sign == "(") - (sign == ")")
            if kind in ("arrow", "mark") and depth == 0 and sign not in ("(", ")"):
                marks.append(Mark(sign, *found.span()))
        return line, marks

    def _set(self, setting: str, text: str) -> None:
        if setting == "species":
            for part in self._parts(text):
                name = self._name(part, "a species")
                if name in self.species:
                    raise ValueError(f"species {name!r} comes twice, or after a reaction that names it")
                self.species[name] = None
            return
        if setting == "observable":
            name, equals, formula = (text[:0], "", "") if not text else self._equation(text)
            if not equals or name in self.observables:
                raise ValueError(f"{text!r} came; expected a name that is new, as in 'observable: total = A + 2 * AB'")
            self.observables[name] = Written(self.number, self.line, formula)
            return
        if setting in self.settings or not text:
            raise ValueError(f"{setting} {'comes twice' if text else 'is empty'}; expected it once, with a value")
        self.settings[setting] = text
        if setting == "time unit":
            self.made.time_unit = text
            return
        if text not in COMBINATIONS:
            some = ", ".join(COMBINATIONS)
            raise ValueError(f"combinations: {text!r} came; expected one of {some}{meant(text, COMBINATIONS)}")
        self.made.combinations = text

    def _parts(self, text: str) -> list[str]:
        """What commas divide."""
        _, marks = self._divided(text)
        ends = [mark.start for mark in marks if mark.sign == ","]
        return [text[begin:end] for begin, end in zip([0, *(end + 1 for end in ends)], [*ends, len(text)], strict=True)]

    def _equation(self, text: str) -> tuple[str, str, str]:
        _, marks = self._divided(text)
        if not marks or marks[0].sign != "=":
            return "", "", ""
        return self._name(text[: marks[0].start], "an observable"), "=", text[marks[0].end :]

    def _assign(self, name: str, formula: str) -> None:
        key = self._name(name, "a parameter or a species")
        if key in self.assigned:
            raise ValueError(f"{key!r} has a value in line {self.assigned[key].number} already; expected one")
        if not formula.strip():
            raise ValueError(f"{key!r} has no value; expected a number or a formula of parameters")
        self.assigned[key] = Written(self.number, self.line, formula.strip())

    def _name(self, text: str, what: str) -> str:
        tokens = list(tokens_of(text))
        if len(tokens) != 1:
            raise ValueError(f"{text.strip()!r} came where {what} was expected: one word, or any text in quotes")
        return self._named(tokens[0])

    def _named(self, token: Token) -> str:
        """The name that a word or a quoted text stands for."""
        if token.kind == "word":
            if quoted(token.text) != token.text:
                raise ValueError(f"{token.text!r} means something in formulas; quote it where it is a name")
            return token.text
        if token.kind != "quoted":
            raise ValueError(f"{token.text!r} came where a name was expected: one word, or any text in quotes")
        names: list[str] = []
        node_of(token.text, Graph(), lambda name: names.append(name) or 0)  # type: ignore[func-returns-value]
        return names[0]

    def _react(self, label: str, line: str, begin: int, arrow: Mark, commas: list[Mark]) -> None:
        if arrow.sign not in ("->", "<->"):
            raise ValueError(f"the arrow {arrow.sign!r} at column {arrow.start + 1}; expected -> or <->")
        is_two_way = arrow.sign == "<->"
        ends = [mark.start for mark in commas if mark.start > arrow.start]
        after, *rates = (
            line[first:last]
            for first, last in zip([arrow.end, *(end + 1 for end in ends)], [*ends, len(line)], strict=True)
        )
        before = self._side(line[begin : arrow.start], "before")
        made = self._side(after, "after")
        if len(rates) != 1 + is_two_way or not all(rate.strip() for rate in rates):
            n = sum(bool(rate.strip()) for rate in rates)
            form = "two, as in 'A <-> B, k1, k2'" if is_two_way else "one, as in 'A -> B, k'"
            both = "; write <-> for both directions" if n == 2 and not is_two_way else ""
            raise ValueError(f"{n or 'no'} rate{'s' * (n != 1)} after the products; expected {form}{both}")
        name = label or self._free_name()
        names = [name, BACKWARD.format(name)][: len(rates)]
        for each, pair, rate in zip(names, [(before, made), (made, before)], rates, strict=False):
            if each in self.labels:
                raise ValueError(f"a reaction is called {each!r} already; every name must differ")
            if len(self.labels) == MOST_REACTIONS:
                raise ValueError(f"more than {MOST_REACTIONS} reactions; that many are read at most")
            self.labels.add(each)
            self.reactions.append((each, pair, Written(self.number, self.line, rate.strip())))

    def _free_name(self) -> str:
        n = len(self.reactions) + 1
        while f"r{n}" in self.labels:
            n += 1
        return f"r{n}"

    def _side(self, text: str, where: str) -> dict[str, int]:
        """Copies of each species on one side of a reaction."""
        if text.strip() in ("0", "∅"):
            return {}
        copies: dict[str, int] = {}
        tokens = [*tokens_of(text), Token("end", "", len(text))]
        i = 0
        while True:
            n = 1
            if tokens[i].kind == "number":
                n = self._copies(tokens[i].text)
                i += 1 + (tokens[i + 1].text == "*")
            if tokens[i].kind not in ("word", "quoted"):
                came = f"{tokens[i].text!r} came" if tokens[i].text else "nothing came"
                raise ValueError(f"{came} where a species {where} the arrow was expected; nothing is written 0")
            name = self._named(tokens[i])
            self.species.setdefault(name)
            copies[name] = copies.get(name, 0) + n
            i += 1
            if tokens[i].kind == "end":
                return copies
            if tokens[i].text != "+":
                raise ValueError(
                    f"{tokens[i].text!r} came after {name!r}, {where} the arrow; expected + and a species"
                    + (", or a comma and the rate" if where == "after" else ", or the arrow")
                )
            i += 1

    def _copies(self, text: str) -> int:
        value = float(text)
        if value != int(value) or not 1 <= value <= MOST_COPIES:
            raise ValueError(f"{text} copies; expected a whole number from 1 to {MOST_COPIES}, or 0 alone for nothing")
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
        for name, written in self.assigned.items():
            if name not in self.species:
                formula = self._formula(written, known)
                known[name] = self._number(written, f"parameter {name!r}", values.get(name, formula), known)
                given[name] = formula if formula.parameters and name not in values else known[name]
        self.made.parameters = Parameters(given)
        for name, written in self.assigned.items():
            if name in self.species:
                is_plain = COUNT.fullmatch(written.text)
                initial[name] = int(written.text) if is_plain else self._formula(written, known)
                if self._number(written, f"the count of {name!r}", initial[name], {}) < 0:
                    raise self._wrong(written, f"{written.text} copies of {name!r}; expected at least 0")
        self.made.parameters = Parameters(given, {}, initial)

    def _read_rate(self, name: str, written: Written) -> None:
        rate = float(written.text) if re.fullmatch(NUMBER, written.text) else self._formula(written)
        if isinstance(rate, Expression) and (rate.reads_time or rate.species):  # all but parameters are species
            self.made.laws[name] = rate
            return
        self.made.rates[name] = rate
        value = self._number(written, "the rate", rate, {})
        if value < 0:
            raise self._wrong(written, f"the rate is {value:g}; expected at least 0")

    def _formula(self, written: Written, known: Mapping[str, float] | None = None) -> Expression:
        """A formula with the values of its parameters; without counts where only `known` parameters may be read."""
        values = self.made.parameters.values if known is None else known

        def named(name: str) -> int:
            if name in values:
                self.used.add(name)
            elif known is not None and name in (*self.species, *self.assigned):
                where = "a species" if name in self.species else f"given in line {self.assigned[name].number}, below"
                raise ValueError(f"{name!r} is {where}; expected parameters that are given above")
            elif name not in self.species:
                hint = meant(name, [*values, *self.species]) or (
                    " (numbers have no units here)"
                    if name in UNITS
                    else f"; give it a value, as by a line '{quoted(name)} = 1e-3'"
                )
                raise ValueError(f"unknown name {name!r}{hint}")
            return self.graph.name(name)

        def read() -> Expression:
            place = node_of(written.text, self.graph, named)
            formula = self.graph.formula(place)
            used = [str(node.value) for node in formula if node.code == Code.COUNT]
            return Expression.of(formula, {name: values[name] for name in used if name in values})

        return self._told(written, read)

    def _number(self, written: Written, what: str, given: float | Expression, values: Mapping[str, float]) -> float:
        return self._told(written, lambda: number_of(what, given, values))

    def _told(self, written: Written, act: Callable[[], T]) -> T:
        """What is done for a line; an error says which."""
        try:
            return act()
        except ValueError as error:
            raise self._wrong(written, str(error)) from None

    def _wrong(self, written: Written, fault: str) -> ValueError:
        return ValueError(f"line {written.number}, {shortened(written.line.strip())!r}: {fault}")
