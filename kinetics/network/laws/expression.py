"""Expressions in species counts, parameters and time, such as "vmax * S / (K + S)"."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property

from kinetics.network.checks import some_names
from kinetics.network.laws.graph import TRUTHS, Code, Graph, Node
from kinetics.network.laws.reading import RESERVED, TIME, check_length, node_of, shortened
from kinetics.network.laws.writing import quoted, text_of
from kinetics.support.frozen import set_fields


@dataclass(frozen=True)
class Expression:
    """A formula in counts, parameters and time, such as a rate law.

    text : + - * / % **, comparisons (1 or 0), and, or, not, `reading.FUNCTIONS`, pi, and t for the time in tu. Any
        other name is a parameter or a species; one that is no plain name, or that is t or pi, is quoted: "k * 'A-B'"
    parameters : name -> value
    formula : its nodes, parts before wholes, the last is the whole; see `graph`

    Logarithms are natural, angles in radian, % is the remainder with the sign of the divisor. Reading it, its program
    and its values take work in proportion to the text, or to the nodes where those are given.

    >>> from kinetics.network.laws import Expression
    >>> law = Expression("vmax * A / (K + A)", {"vmax": 2.0, "K": 10.0})
    >>> law.species, law.reads_time, law.with_numbers().text
    (('A',), False, '2 * A / (10 + A)')
    """

    text: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    formula: tuple[Node, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.text, str) or not self.text.strip():
            raise ValueError(f"{self.text!r} is no expression; expected text such as 'k * A * B'")
        check_length(self.text)
        text, parameters, graph = " ".join(self.text.split()), {}, Graph()
        for name, value in self.parameters.items():
            is_number = isinstance(value, int | float) or hasattr(value, "__float__")
            if isinstance(value, bool | str) or not is_number or not math.isfinite(value):
                raise ValueError(f"parameter {name!r} = {value!r}; expected a finite number")
            if name in RESERVED:
                raise ValueError(f"a parameter cannot be called {name!r}: that is {_meaning(name)}")
            parameters[name] = float(value)
        set_fields(self, text=text, parameters=parameters, formula=graph.formula(node_of(text, graph)))

    @classmethod
    def of(cls, formula: Sequence[Node], parameters: Mapping[str, float] | None = None) -> Expression:
        """An expression of nodes, as `Graph.formula` hands them out; its text is made when it is first asked for."""
        made = object.__new__(cls)
        set_fields(made, parameters=dict(parameters or {}), formula=tuple(formula))
        return made

    def __getattr__(self, name: str) -> str:
        """The text of an expression that was made of nodes."""
        if name != "text" or "formula" not in self.__dict__:
            raise AttributeError(f"an expression has no {name!r}")
        set_fields(self, text=text_of(self.formula))
        return self.text

    def with_parameters(self, values: Mapping[str, float]) -> Expression:
        """A copy with new values for the named parameters; the others keep theirs."""
        made = copy(self)
        given = {name: values[name] for name in self._names if name in values}
        set_fields(made, parameters={**self.parameters, **given})
        return made

    def with_numbers(self, kept: Collection[str] = ()) -> Expression:
        """A copy with numbers in place of its parameters, except those in `kept`."""
        graph = Graph(most=3 * len(self.formula) + len(self.parameters) + 10)
        numbers = {name: graph.number(value) for name, value in self.parameters.items() if name not in kept}
        if not numbers:
            return self
        place = graph.copied(self.formula, numbers)[-1]
        left = {name: value for name, value in self.parameters.items() if name in kept}
        return Expression.of(graph.formula(place), left)

    def __str__(self) -> str:
        used = {name: self.parameters[name] for name in self._names if name in self.parameters}
        values = ", ".join(f"{name} = {value:g}" for name, value in used.items())
        return f"{shortened(self.text)}  ({values})" if values else shortened(self.text)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        """Every name that is no function, t or pi, in the order of their first use."""
        return tuple(str(node.value) for node in self.formula if node.code == Code.COUNT)

    @property
    def species(self) -> tuple[str, ...]:
        """The names that are not parameters, in the order of their first use."""
        return tuple(name for name in self._names if name not in self.parameters)

    @property
    def reads_time(self) -> bool:
        """Whether it depends on the time."""
        return any(node.code == Code.CLOCK for node in self.formula)

    @property
    def is_condition(self) -> bool:
        """Whether it is true or false, not a number."""
        return self.formula[-1].code in TRUTHS

    def check_names(self, what: str, species: Mapping[str, int]) -> None:
        """ValueError if a name is neither a parameter nor one of these species, or both."""
        for name in self._names:
            if name not in species and name not in self.parameters:
                known = some_names(self.parameters) or "none"
                raise ValueError(
                    f"{what}: unknown name {name!r} {self._place(name)}; the species are {some_names(species)}, "
                    f"the parameters {known}"
                )
            if name in species and name in self.parameters:
                raise ValueError(f"{what}: {name!r} {self._place(name)} is both a species and a parameter; rename one")

    def _place(self, name: str) -> str:
        spelled = "|".join(map(re.escape, {name, quoted(name)}))
        found = re.search(rf"(?<!\w)(?:{spelled})(?!\w)", self.text)
        return f"at column {found.start() + 1 if found else 1} of {shortened(self.text)!r}"


def _meaning(name: str) -> str:
    return "the time" if name == TIME else "3.14159..."
