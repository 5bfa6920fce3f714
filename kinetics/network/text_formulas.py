"""Formulas in a text of reactions, read once all its names are known."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Collection, Mapping
from math import floor

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import MOST_NODES, Code, Graph
from kinetics.network.laws.reading import FUNCTIONS, node_of, written
from kinetics.network.laws.writing import quoted
from kinetics.network.parameters import CLOSE, meant, number_of
from kinetics.network.source_spans import SourceSpan
from kinetics.network.text_measures import Measures
from kinetics.network.units import (
    CONCENTRATION,
    NUMBER_KIND,
    TIME,
    UNITS,
    Kind,
    Measured,
    kind_of,
    kind_text,
    kinds_of_order,
    per_combination,
    quantity_in,
)

ELSEWHERE = {  # what others write
    **dict.fromkeys(("if", "then", "else"), " (a choice is written piecewise(value, condition, otherwise))"),
    **dict.fromkeys(("time", "Time", "TIME"), " (the time is t)"),
}


class TextFormulas:
    """The formulas of one text, and what they read.

    length : characters of the text, to which its formulas are in proportion
    species : names of the species
    written : parameter, or species with a count at time 0 -> where its value stands
    values : parameter -> value, of those that are known so far
    used : parameters that formulas read
    measures : volume and unit of time
    factors : parameter -> what one of its unit is in copies and units of time, of those with units
    kinds : parameter -> the kind of its unit, of those that have one, or follow from others that do
    """

    def __init__(self, length: int, species: dict[str, None], written: dict[str, SourceSpan]):
        self.graph = Graph(MOST_NODES + length)
        self.species, self.written = species, written
        self.values: dict[str, float] = {}
        self.used: set[str] = set()
        self._known: Collection[str] = ChainMap[str, object](species, written, self.values)  # type: ignore[arg-type]
        self.measures = Measures()
        self.factors: dict[str, float] = {}
        self.kinds: dict[str, Kind] = {}

    def read(self, span: SourceSpan, only_parameters: bool = False) -> Expression:
        """The formula in a span. ValueError, with line and column, for an unknown name or no formula.

        only_parameters : whether it may read parameters given above alone, no counts
        """
        return self.measured(span, only_parameters)[0]

    def measured(self, span: SourceSpan, only_parameters: bool = False) -> tuple[Expression, Kind | None]:
        """`read` in copies and units of time, and the kind of unit that it had; None without units."""
        given = self.quantity(span)
        if given is not None:
            value = given.value * span.located(lambda: self.measures.factor(given))
            return span.located(lambda: self.expression(self.graph.number(value))), given.unit.kind

        def read() -> tuple[Expression, Kind | None]:
            found = self.expression(node_of(span.text, self.graph, self._named(only_parameters)))
            has_units = not self.kinds.keys().isdisjoint(found.parameters)
            return found, kind_of(found.formula, self.kinds, self.species) if has_units else None

        return span.located(read)

    def quantity(self, span: SourceSpan) -> Measured | None:
        """The number with a unit in a span; None for anything else. ValueError, with line and column, if it is none."""
        return span.located(lambda: quantity_in(span.text, self._known))

    def timed(self, span: SourceSpan, only_parameters: bool = False) -> Expression:
        """`read` of a time. ValueError, with line and column, for another unit."""
        found, kind = self.measured(span, only_parameters)
        if kind not in (None, NUMBER_KIND, TIME):
            raise span.wrong(f"{span.text} has the unit {kind_text(kind)}; expected a time, such as 5 min")
        return found

    def counted(self, span: SourceSpan, only_parameters: bool = False) -> Expression:
        """`read` of a count; a concentration becomes the nearest whole number of copies, from half a copy on.

        ValueError, with line and column, for another unit, or for a concentration that is less than half a copy
        """
        found, kind = self.measured(span, only_parameters)
        if kind in (None, NUMBER_KIND):
            return found
        if kind != CONCENTRATION:
            raise span.wrong(f"{span.text} has the unit {kind_text(kind)}; expected copies or a concentration")
        copies = None if found.species or found.reads_time else self.number(span, "the count", found)
        whole = written("floor(x + 0.5)", self.graph, x=self.graph.copied(found.formula)[-1])
        if copies is None:
            return self.expression(whole)
        if 0 < copies < 0.5:
            raise span.wrong(
                f"{span.text} is {copies:.3g} copies, which rounds to none; expected at least half a copy: give a "
                "larger volume, or write 0"
            )
        if abs(copies - round(copies)) > CLOSE * copies:
            self.measures.notes.append(f"{span.text} is {copies:.6g} copies, rounded to {floor(copies + 0.5)}")
        return self.expression(whole if found.parameters else self.graph.number(floor(copies + 0.5)))

    def per_combination(
        self, span: SourceSpan, rate: Expression, kind: Kind, reactants: Mapping[str, int], combinations: str
    ) -> Expression:
        """A rate constant with units as that of a network; ValueError, with line and column, if they do not fit."""
        n = sum(reactants.values())
        kinds = kinds_of_order(n)
        if kind not in kinds:
            some = " or ".join(kind_text(each, self.measures.time_unit or "s") for each in kinds)
            raise span.wrong(
                f"{span.text} has the unit {kind_text(kind)}; a reaction of order {n} (copies of reactants) has a rate "
                f"constant in {some}"
            )
        factor = span.located(lambda: per_combination(reactants, combinations))
        if factor == 1:
            return rate
        return self.expression(
            self.graph.add(Code.MULTIPLY, (self.graph.number(factor), self.graph.copied(rate.formula)[-1]))
        )

    def expression(self, place: int) -> Expression:
        """A node of the graph with the values of the parameters that it reads."""
        formula = self.graph.formula(place)
        used = [str(node.value) for node in formula if node.code == Code.COUNT]
        return Expression.of(formula, {name: self.values[name] for name in used if name in self.values})

    def number(self, span: SourceSpan, what: str, given: float | Expression) -> float:
        """The number that a formula of parameters comes to; ValueError, with line and column, if it comes to none."""
        return span.located(lambda: number_of(what, given, self.values))

    def _named(self, only_parameters: bool) -> Callable[[str], int]:
        def named(name: str) -> int:
            if name in self.values:
                self.used.add(name)
            elif only_parameters and (name in self.species or name in self.written):
                where = "a species" if name in self.species else f"given in line {self.written[name].number}, below"
                raise ValueError(f"{name!r} is {where}; expected parameters that are given above")
            elif name not in self.species:
                raise ValueError(f"unknown name {name!r}{self._cure(name)}")
            place = self.graph.name(name)
            if self.factors.get(name, 1.0) == 1:
                return place
            return self.graph.add(Code.MULTIPLY, (self.graph.number(self.factors[name]), place))

        return named

    def _cure(self, name: str) -> str:
        """What to do about a name that is not known."""
        if name in FUNCTIONS:
            return f" (the function wants its arguments, as in {name}(...))"
        if name in ELSEWHERE:
            return ELSEWHERE[name]
        units = " (a unit stands behind a number alone, as in k = 1e6 /M/s)" if name in UNITS else ""
        known = [*self.values, *self.species]
        return meant(name, known) or units or f"; give it a value, as by a line '{quoted(name)} = 1e-3'"
