"""What the ids of an SBML model stand for: numbers at time 0, and formulas over amounts and time from then on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from kinetics.formats.sbmlmath import Functions, names_in, node_of
from kinetics.formats.scaling import is_count
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import MOST_NODES, Code, Graph, in_order
from kinetics.network.laws.program import learn_numbers

INITIAL, MEANING = "initial", "meaning"


class SbmlError(ValueError):
    """A fault whose message already has file and line."""


class SbmlNames:
    """The ids of one model, each resolved when it is first asked for.

    states : ids of the species that a state counts: all that no rule gives, and that are not `numbers`
    numbers : id -> amount, of the species that nothing changes and that are no whole number of copies
    size : of the document, bytes, to which its formulas are in proportion
    rules : id -> its assignment rule
    values : id -> value, of the parameters that formulas read by name
    settled : those of them of which something is a plain number, which another value would not reach

    A rule, an assignment, a trigger or the like without its math does nothing, as Level 3 Version 2 has it.
    """

    def __init__(self, path: Path, source: Any, size: int, copies_per_unit: float | None = None):
        self.path, self.source = path, source
        self.compartments = {each.getId(): each for each in self.each("Compartments")}
        self.species = {each.getId(): each for each in self.each("Species")}
        self.parameters = {each.getId(): each for each in self.each("Parameters")}
        self.reactions = {each.getId(): each for each in self.each("Reactions")}
        self.references = {each.getId(): each for each in self._references() if each.getId()}
        self.rules = {each.getVariable(): each for each in self.each("Rules") if each.isSetMath()}
        self.assignments = {each.getSymbol(): each for each in self.each("InitialAssignments") if each.isSetMath()}
        self.graph = Graph(MOST_NODES + size // 4)
        self._known: list[float | None] = []  # the numbers of the graph's first nodes
        self._valued: list[float | None] = []  # the same, with the values of parameters
        self.values: dict[str, float] = {}
        self.settled: set[str] = set()
        self._functions = Functions({each.getId(): each for each in self.each("FunctionDefinitions")}, self.graph)
        self._found: dict[tuple[str, str], float | ValueError] = {}
        self.numbers = self._numbers(copies_per_unit or 1.0)
        self.states = [name for name in self.species if name not in self.rules and name not in self.numbers]

    def _numbers(self, scale: float) -> dict[str, float]:
        """Amounts of the species that nothing changes, of those that no count can be: an enzyme of 0.5."""
        changed = {name for reaction in self.each("Reactions") for name in _changed_by(reaction)}
        held = {name for name, each in self.species.items() if each.getBoundaryCondition() or each.getConstant()}
        changed = (changed - held) | self.rules.keys()
        changed |= {each.getVariable() for event in self.each("Events") for each in event.getListOfEventAssignments()}
        found = {}
        for name in self.species:
            if name not in changed:
                with suppress(ValueError):  # one without an amount, which is reported if it is read
                    amount = self.initial_amount(name)
                    if 0 <= amount < math.inf and not is_count(amount * scale):
                        found[name] = amount
        return found

    def each(self, plural: str) -> list[Any]:
        """All members of one of the model's lists."""
        listed = getattr(self.source, f"getListOf{plural}")()
        return [listed.get(i) for i in range(listed.size())]

    def _references(self) -> list[Any]:
        sides = [
            side
            for reaction in self.each("Reactions")
            for side in (reaction.getListOfReactants(), reaction.getListOfProducts())
        ]
        return [side.get(i) for side in sides for i in range(side.size())]

    def initial(self, name: str) -> float:
        """The value of an id at time 0: by its initial assignment, its rule or as stated."""
        return float(self._resolved(INITIAL, name))

    def initial_amount(self, name: str) -> float:
        """The amount of a species at time 0."""
        species = self.species[name]
        if name not in self.assignments and species.isSetInitialAmount():
            return float(species.getInitialAmount())
        return self.initial(name) * self._initial_size(name)

    def meaning(self, name: str) -> int:
        """The node that stands for an id from time 0 on: a formula over the amounts of the states, and t."""
        return int(self._resolved(MEANING, name))

    def size(self, name: str) -> int:
        """What turns the value of a species in formulas into its amount: 1, or the size of its compartment."""
        species = self.species[name]
        return self.graph.number(1.0) if self._is_amount(species) else self.meaning(species.getCompartment())

    def node(self, element: Any, math_: Any) -> int:
        """A formula of an element, over the amounts of the states, and t."""
        return self._node(element, math_, self.meaning, self.graph.time())

    def law(self, reaction: Any) -> int:
        """The rate of a reaction."""
        return self._law(reaction, self.meaning, self.graph.time())

    def number(self, element: Any, math_: Any) -> float:
        """What a formula comes to at time 0."""
        return self._value(self._node(element, math_, self._initial_node, self.graph.number(0.0)))

    def constant(self, place: int) -> float | None:
        """The number that a node is at all times; None if it depends on counts or time."""
        learn_numbers(self.graph.nodes, self._valued, self.values)
        if self._plain(place) is None and self._valued[place] is not None:
            self.settled |= {str(self.graph.nodes[each].value) for each in in_order(self.graph.nodes, place)}
        return self._valued[place]

    def _plain(self, place: int) -> float | None:
        """The number that a node is whatever the values of parameters."""
        learn_numbers(self.graph.nodes, self._known)
        return self._known[place]

    def expression(self, place: int) -> Expression:
        """A node as an expression."""
        formula = self.graph.formula(place)
        read = [str(node.value) for node in formula if node.code == Code.COUNT]
        return Expression.of(formula, {name: self.values[name] for name in read if name in self.values})

    def wrong(self, element: Any, fault: str) -> SbmlError:
        """The fault with file and line."""
        return SbmlError(f"{self.path}, line {element.getLine()}: {fault}")

    def _resolved(self, kind: str, name: str) -> float:
        """The value at time 0, or the node, of an id; what it needs comes first, without recursion."""
        opened: dict[str, None] = {}
        waiting = [] if (kind, name) in self._found else [name]
        while waiting:
            each = waiting[-1]
            needed = [] if each in opened or (kind, each) in self._found else self._needed(kind, each)
            if needed:
                opened[each] = None
                circle = [other for other in needed if other in opened]
                if circle:
                    self._found[kind, each] = ValueError(f"values go round in a circle: {', '.join(opened)}")
                waiting += [other for other in needed if other not in opened]
                continue
            if (kind, each) not in self._found:
                try:
                    self._found[kind, each] = self._initial_of(each) if kind == INITIAL else self._meaning_of(each)
                except ValueError as error:  # told where the id is used
                    self._found[kind, each] = error
            opened.pop(each, None)
            waiting.pop()
        found = self._found[kind, name]
        if isinstance(found, ValueError):
            raise found
        return found

    def _needed(self, kind: str, name: str) -> list[str]:
        """The ids that must be known before an id is, of those that are not."""
        given = self.assignments.get(name) if kind == INITIAL else None
        given = given or self.rules.get(name)
        law = self.reactions[name].getKineticLaw() if name in self.reactions else None
        math_ = given.getMath() if given else law.getMath() if law else None
        ids = list(names_in(math_)[0]) if math_ is not None else []
        if name in self.species:
            ids.append(self.species[name].getCompartment())
        return [each for each in ids if (kind, each) not in self._found]

    def _initial_of(self, name: str) -> float:
        given = self.assignments.get(name) or self.rules.get(name)
        return self._stated(name) if given is None else self.number(given, given.getMath())

    def _initial_node(self, name: str) -> int:
        self.settled.add(name)
        return self.graph.number(self.initial(name))

    def _stated(self, name: str) -> float:
        """The number that the element itself states."""
        if name in self.species:
            return self._stated_of_species(name)
        if name in self.reactions:
            return self._value(self._law(self.reactions[name], self._initial_node, self.graph.number(0.0)))
        reference = self.references.get(name)
        if reference is not None and reference.isSetStoichiometryMath():
            return self.number(reference, reference.getStoichiometryMath().getMath())
        place, parameter = self.compartments.get(name), self.parameters.get(name)
        value = math.nan
        if parameter is not None and parameter.isSetValue():
            value = parameter.getValue()
        elif place is not None and place.isSetSize():
            value = place.getSize()
        elif place is not None and (
            place.getLevel() == 1 or (place.getLevel() == 2 and not place.getSpatialDimensions())
        ):
            value = 1.0  # the default of Level 1; Level 2 takes amounts for concentrations if there is no dimension
        elif reference is not None:
            value = reference.getStoichiometry() / reference.getDenominator()  # nan if Level 3 states none
        if math.isnan(value):
            raise ValueError(f"{name!r} in a formula is neither a species, a compartment nor a parameter with a value")
        return float(value)

    def _stated_of_species(self, name: str) -> float:
        species = self.species[name]
        if species.isSetInitialAmount():
            amount = float(species.getInitialAmount())
            return amount if self._is_amount(species) else amount / self._initial_size(name)
        if not species.isSetInitialConcentration():
            raise ValueError(f"species {name!r} has no initial amount")
        concentration = float(species.getInitialConcentration())
        return concentration * self.initial(species.getCompartment()) if self._is_amount(species) else concentration

    def _is_amount(self, species: Any) -> bool:
        """Whether formulas mean its amount, and not its concentration."""
        return bool(species.getHasOnlySubstanceUnits())

    def _initial_size(self, name: str) -> float:
        species = self.species[name]
        if self._is_amount(species):
            return 1.0
        size = self.initial(species.getCompartment())
        if not 0 < size < math.inf:
            raise self.wrong(species, f"species {name!r} is a concentration in a volume of {size:g}")
        return size

    def _meaning_of(self, name: str) -> int:
        if name in self.rules:
            rule = self.rules[name]
            place = self.node(rule, rule.getMath())
            value = self._plain(place)
            return place if value is None else self.graph.number(value)
        if name in self.species:
            self._initial_size(name)  # which must be above 0
            size = self.size(name)
            amount = self._number(name) if name in self.numbers else self.graph.name(name)
            return amount if self.graph.is_known(size, 1.0) else self.graph.add(Code.DIVIDE, (amount, size))
        if name in self.reactions:
            return self.law(self.reactions[name])
        return self._number(name)

    def _number(self, name: str) -> int:
        """The node of what nothing changes: its name, if a number is stated that another one could replace."""
        value = self.numbers[name] if name in self.numbers else self.initial(name)
        is_open = name in self.parameters or name in self.numbers
        if not is_open or name in self.assignments or not math.isfinite(value):
            return self.graph.number(value)
        self.values[name] = value
        return self.graph.name(name)

    def _law(self, reaction: Any, meaning: Callable[[str], int], time: int) -> int:
        law = reaction.getKineticLaw()
        if law is None or not law.isSetMath():
            raise self.wrong(reaction, f"reaction {reaction.getId()!r} has no kinetic law")
        own = {}
        for i in range(law.getNumParameters()):  # those of Level 3, too
            parameter = law.getParameter(i)
            own[parameter.getId()] = parameter.getValue()
        return self._node(
            law, law.getMath(), lambda name: self.graph.number(own[name]) if name in own else meaning(name), time
        )

    def _node(self, element: Any, math_: Any, meaning: Callable[[str], int], time: int) -> int:
        try:
            return node_of(math_, self.graph, meaning, self._functions.call, time)
        except SbmlError:
            raise
        except ValueError as error:
            raise self.wrong(element, str(error)) from None

    def _value(self, place: int) -> float:
        value = self.constant(place)
        assert value is not None, "every name at time 0 is a number"  # noqa: S101
        return value


def _changed_by(reaction: Any) -> set[str]:
    """Species whose amount a reaction changes, as written."""
    net: Counter[str] = Counter()
    changed = set()
    for sign, side in ((-1, reaction.getListOfReactants()), (1, reaction.getListOfProducts())):
        for reference in side:
            net[reference.getSpecies()] += sign * reference.getStoichiometry()
            if reference.getId() or reference.isSetStoichiometryMath():  # another number may take its place
                changed.add(reference.getSpecies())
    return changed | {name for name, gain in net.items() if gain}
