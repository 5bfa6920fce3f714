"""Formulas in a text of reactions, read once all its names are known."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import MOST_NODES, Code, Graph
from kinetics.network.laws.reading import FUNCTIONS, node_of
from kinetics.network.laws.writing import quoted
from kinetics.network.parameters import meant, number_of
from kinetics.network.source_spans import SourceSpan

UNITS = ("s", "ms", "min", "h", "d", "M", "mM", "uM", "nM", "mol", "tu")  # that often stand behind a number
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
    """

    def __init__(self, length: int, species: Collection[str], written: Mapping[str, SourceSpan]):
        self.graph = Graph(MOST_NODES + length)
        self.species, self.written = species, written
        self.values: dict[str, float] = {}
        self.used: set[str] = set()

    def read(self, span: SourceSpan, only_parameters: bool = False) -> Expression:
        """The formula in a span. ValueError, with line and column, for an unknown name or no formula.

        only_parameters : whether it may read parameters given above alone, no counts
        """
        return span.located(lambda: self.expression(node_of(span.text, self.graph, self._named(only_parameters))))

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
            return self.graph.name(name)

        return named

    def _cure(self, name: str) -> str:
        """What to do about a name that is not known."""
        if name in FUNCTIONS:
            return f" (the function wants its arguments, as in {name}(...))"
        if name in ELSEWHERE:
            return ELSEWHERE[name]
        units = " (numbers have no units here)" if name in UNITS else ""
        known = [*self.values, *self.species]
        return meant(name, known) or units or f"; give it a value, as by a line '{quoted(name)} = 1e-3'"
