"""The consistency checks of libsbml, without those whose cost explodes on small files.

libsbml follows what depends on what along every path: 20 functions that call each other, or 1,000 rules in a row, take
it minutes. So it is shown each formula without what it needs of others of its kind; whether these go round in a circle,
and what functions are called with, is found when the formulas become a graph.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from kinetics.formats.sbmlmath import names_in, parts_of
from kinetics.support.packages import libsbml


def check_consistency(document: Any) -> None:
    """Check a document, whose errors then list what was found; its formulas are afterwards what they were."""
    model = document.getModel()
    shortened = [*_functions_alone(model), *_formulas_alone(model)]
    kept = [(element, element.getMath().deepCopy()) for element, _ in shortened]
    for element, math_ in shortened:
        element.setMath(math_)
    document.checkConsistency()
    for element, math_ in kept:
        element.setMath(math_)


def _functions_alone(model: Any) -> Iterator[tuple[Any, Any]]:
    """Functions that call others, each with a function of the same kind of value that calls none."""
    listed = [model.getFunctionDefinition(i) for i in range(model.getNumFunctionDefinitions())]
    defined = {each.getId(): each for each in listed}
    for each in listed:
        if each.getBody() is None or not names_in(each.getBody())[1]:
            continue
        arguments = "".join(f"a{i}, " for i in range(each.getNumArguments()))
        value = "true" if _is_truth(each.getBody(), defined) else "0"
        yield each, libsbml.parseL3Formula(f"lambda({arguments}{value})")


def _formulas_alone(model: Any) -> Iterator[tuple[Any, Any]]:
    """Rules and assignments without the ids that others give, and laws without the rates of reactions."""
    reactions = [model.getReaction(i) for i in range(model.getNumReactions())]
    rules = [model.getRule(i) for i in range(model.getNumRules())]
    assignments = [model.getInitialAssignment(i) for i in range(model.getNumInitialAssignments())]
    rates = {each.getId() for each in reactions}
    given = rates | {each.getVariable() for each in rules} | {each.getSymbol() for each in assignments}
    laws = [each.getKineticLaw() for each in reactions if each.isSetKineticLaw()]
    for elements, names in (([*rules, *assignments], given), (laws, rates)):
        for each in elements:
            made = _without(each.getMath(), names) if each.isSetMath() else None
            if made is not None:
                yield each, made


def _without(math_: Any, names: Collection[str]) -> Any | None:
    """A formula with a number in place of some ids; None if it has none of them."""
    if names_in(math_)[0].keys().isdisjoint(names):
        return None
    made = math_.deepCopy()
    for part in parts_of(made):
        if part.getType() == libsbml.AST_NAME and part.getName() in names:
            part.setValue(1.0)
    return made


def _is_truth(body: Any, defined: dict[str, Any]) -> bool:
    """Whether a formula is true or false, as far as its form shows it."""
    for _ in range(len(defined) + 100):  # functions may call each other in a circle
        kind = body.getType()
        if kind == libsbml.AST_FUNCTION and body.getName() in defined:
            body = defined[body.getName()].getBody()
        elif kind == libsbml.AST_FUNCTION_PIECEWISE and body.getNumChildren():
            body = body.getChild(0)
        else:
            return bool(body.isBoolean())
        if body is None:
            return False
    return False
