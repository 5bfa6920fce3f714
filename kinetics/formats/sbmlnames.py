"""What the ids of an SBML model stand for: numbers at time 0, and formulas over amounts and time from then on."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from kinetics.formats.sbmlmath import Functions, TooLongError, number_text, text_of
from kinetics.network.laws.expression import Expression, quoted
from kinetics.network.laws.program import evaluate, steps_of


class SbmlError(ValueError):
    """A fault that is already told with file and line."""

    is_too_long = False  # of a formula, which may do no harm


class SbmlNames:
    """The ids of one model, each resolved when it is first asked for.

    states : ids of the species that a state counts: all that no rule gives
    rules : id -> its assignment rule

    A rule, an assignment, a trigger or the like without its math does nothing, as Level 3 Version 2 has it.
    """

    def __init__(self, path: Path, source: Any):
        self.path, self.source = path, source
        self.compartments = {each.getId(): each for each in self.each("Compartments")}
        self.species = {each.getId(): each for each in self.each("Species")}
        self.parameters = {each.getId(): each for each in self.each("Parameters")}
        self.reactions = {each.getId(): each for each in self.each("Reactions")}
        self.references = {each.getId(): each for each in self._references() if each.getId()}
        self.rules = {each.getVariable(): each for each in self.each("Rules") if each.isSetMath()}
        self.assignments = {each.getSymbol(): each for each in self.each("InitialAssignments") if each.isSetMath()}
        self.states = [name for name in self.species if name not in self.rules]
        self._functions = Functions({each.getId(): each for each in self.each("FunctionDefinitions")})
        self._initial: dict[str, float] = {}
        self._meanings: dict[str, str] = {}
        self._open: list[tuple[str, str]] = []  # what is being resolved: initial or meaning, and id

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
        if name not in self._initial:
            given = self.assignments.get(name) or self.rules.get(name)
            self._initial[name] = self._apart(
                "initial", name, lambda: self._stated(name) if given is None else self.number(given, given.getMath())
            )
        return self._initial[name]

    def initial_amount(self, name: str) -> float:
        """The amount of a species at time 0."""
        species = self.species[name]
        if name not in self.assignments and species.isSetInitialAmount():
            return float(species.getInitialAmount())
        return self.initial(name) * self._initial_size(name)

    def meaning(self, name: str) -> str:
        """What stands for an id from time 0 on: a formula over the amounts of the states, and t."""
        if name not in self._meanings:
            self._meanings[name] = self._apart("meaning", name, lambda: self._meaning(name))
        return self._meanings[name]

    def size(self, name: str) -> str:
        """What turns the value of a species in formulas into its amount: 1, or the size of its compartment."""
        species = self.species[name]
        return "1" if self._is_amount(species) else self.meaning(species.getCompartment())

    def text(self, element: Any, math_: Any) -> str:
        """A formula of an element in our own grammar, over the amounts of the states, and t."""
        return self._text(element, math_, self.meaning)

    def law_text(self, reaction: Any) -> str:
        """The rate of a reaction."""
        return self._law(reaction, self.meaning)

    def number(self, element: Any, math_: Any) -> float:
        """What a formula comes to at time 0."""
        return self._value(element, self._text(element, math_, lambda name: number_text(self.initial(name))))

    def constant(self, element: Any, text: str) -> float | None:
        """The number that a formula is at all times; None where it depends on counts or time."""
        formula = self.expression(element, text)
        return None if formula.species or formula.reads_time else self._value(element, text)

    def expression(self, element: Any, text: str) -> Expression:
        """A formula, parsed."""
        try:
            return Expression(text)
        except ValueError as error:
            raise self.wrong(element, str(error)) from None

    def wrong(self, element: Any, fault: str) -> SbmlError:
        """The fault with file and line."""
        return SbmlError(f"{self.path}, line {element.getLine()}: {fault}")

    def _apart(self, kind: str, name: str, resolve: Callable[[], Any]) -> Any:
        """The result, unless the id needs itself."""
        if (kind, name) in self._open:
            raise ValueError(f"values go round in a circle: {', '.join(each for _, each in self._open)}")
        self._open.append((kind, name))
        try:
            return resolve()
        finally:
            self._open.pop()

    def _stated(self, name: str) -> float:
        """The number that the element itself states."""
        if name in self.species:
            return self._stated_of_species(name)
        if name in self.reactions:
            text = self._law(self.reactions[name], lambda each: number_text(self.initial(each)))
            return self._value(self.reactions[name], text)
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
            value = 1.0  # the default of Level 1; Level 2 takes amounts for concentrations where there is no dimension
        elif reference is not None:
            value = reference.getStoichiometry() / reference.getDenominator()  # nan where Level 3 states none
        if math.isnan(value):
            raise ValueError(f"{name!r} in a formula is neither a species, a compartment nor a parameter with a value")
        return float(value)

    def _stated_of_species(self, name: str) -> float:
        species = self.species[name]
        if species.isSetInitialAmount():
            amount = species.getInitialAmount()
            return amount if self._is_amount(species) else amount / self._initial_size(name)
        if not species.isSetInitialConcentration():
            raise ValueError(f"species {name!r} has no initial amount")
        concentration = species.getInitialConcentration()
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

    def _meaning(self, name: str) -> str:
        if name in self.rules:
            rule = self.rules[name]
            text = f"({self.text(rule, rule.getMath())})"
            value = self.constant(rule, text)
            return text if value is None else number_text(value)
        if name in self.species:
            self._initial_size(name)  # which must be above 0
            size = self.size(name)
            return quoted(name) if size in ("1", "1.0") else f"({quoted(name)} / {size})"
        if name in self.reactions:
            return f"({self.law_text(self.reactions[name])})"
        return number_text(self.initial(name))  # nothing that is read changes it

    def _law(self, reaction: Any, meaning: Callable[[str], str]) -> str:
        law = reaction.getKineticLaw()
        if law is None or not law.isSetMath():
            raise self.wrong(reaction, f"reaction {reaction.getId()!r} has no kinetic law")
        own = {}
        for i in range(law.getNumParameters()):  # those of Level 3, too
            parameter = law.getParameter(i)
            own[parameter.getId()] = parameter.getValue()
        return self._text(law, law.getMath(), lambda name: number_text(own[name]) if name in own else meaning(name))

    def _text(self, element: Any, math_: Any, meaning: Callable[[str], str]) -> str:
        try:
            return text_of(math_, meaning, self._functions)
        except SbmlError:
            raise
        except ValueError as error:
            located = self.wrong(element, str(error))
            located.is_too_long = isinstance(error, TooLongError)
            raise located from None

    def _value(self, element: Any, text: str) -> float:
        formula = self.expression(element, text)
        return float(evaluate(steps_of(formula, {}), np.zeros(0, dtype=np.int64), 0.0))
