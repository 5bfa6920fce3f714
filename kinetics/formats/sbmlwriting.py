"""The writer of SBML files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import factorial
from typing import Any

from kinetics.formats.sbmlformulas import tree_of
from kinetics.formats.sbmlmath import parts_of
from kinetics.network import Model, Network
from kinetics.network.checks import spelled_apart
from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression
from kinetics.network.reactions import sides_of
from kinetics.support.limits import BREAKS, check_visible
from kinetics.support.packages import libsbml

PLACE = "x{}"  # of an id in a formula


def sbml_text(model: Model) -> str:
    """The model in Level 3 Version 1: one volume of size 1, amounts in copies, observables as assignment rules, events.

    Names that no id can have are kept as names, beside an id with _ for the characters in question.
    """
    network = model.network
    if network.laws:
        name = next(iter(network.laws))
        raise ValueError(f"an SBML file is written for mass action alone; the law of channel {name!r} does not fit")
    document = libsbml.SBMLDocument(3, 1)
    made = document.createModel()
    made.setSubstanceUnits("item")
    made.setExtentUnits("item")
    names = ["tank", *network.species, *network.channels, *model.observables, *(each.name for each in network.events)]
    ids = iter(spelled_apart(names, _id))
    place = made.createCompartment()
    place.setId(next(ids))
    place.setConstant(True)
    place.setSize(1.0)
    place.setSpatialDimensions(3.0)
    species = []
    for name, count in zip(network.species, model.initial.tolist(), strict=True):
        each = made.createSpecies()
        species.append(next(ids))
        each.setId(species[-1])
        each.setName(_shown(name))
        each.setCompartment(place.getId())
        if float(f"{count:.15g}") != count:
            raise ValueError(f"{count} copies of {name!r}: libsbml writes 15 digits; expected a count with no more")
        each.setInitialAmount(float(count))
        each.setHasOnlySubstanceUnits(True)
        each.setBoundaryCondition(False)
        each.setConstant(False)
    for r, name in enumerate(network.channels):
        _add_reaction(made.createReaction(), next(ids), name, network, r, species)
    for name, weights in model.observables.items():
        parameter = made.createParameter()
        parameter.setId(next(ids))
        parameter.setName(_shown(name))
        parameter.setConstant(False)
        rule = made.createAssignmentRule()
        rule.setVariable(parameter.getId())
        terms = [f"{weight!r} * {PLACE.format(i)}" for i, weight in enumerate(weights.values())]
        rule.setMath(_formula(" + ".join(terms) or "0", [species[network.index(each)] for each in weights]))
    for event in network.events:
        _add_event(made.createEvent(), next(ids), event, dict(zip(network.species, species, strict=True)))
    return str(libsbml.writeSBMLToString(document))


def _add_event(made: Any, key: str, event: Event, ids: Mapping[str, str]) -> None:
    made.setId(key)
    made.setName(_shown(event.name))
    made.setUseValuesFromTriggerTime(event.from_trigger)
    trigger = made.createTrigger()
    trigger.setInitialValue(event.was_true)
    trigger.setPersistent(event.persistent)
    trigger.setMath(tree_of(event.condition, ids, is_condition=True))
    if event.is_delayed:
        made.createDelay().setMath(tree_of(event.waits, ids))
    if event.priority:
        made.createPriority().setMath(tree_of(Expression(repr(event.priority)), ids))
    for name, formula in event.new_counts.items():
        assignment = made.createEventAssignment()
        assignment.setVariable(ids[name])
        assignment.setMath(tree_of(formula, ids))


def _add_reaction(reaction: Any, key: str, name: str, network: Network, r: int, species: list[str]) -> None:
    reaction.setId(key)
    reaction.setName(_shown(name))
    reaction.setReversible(False)
    reaction.setFast(False)
    before, after = sides_of(network.sparse_reactants, network.sparse_stoichiometry, r)
    for side, add in ((before, reaction.createReactant), (after, reaction.createProduct)):
        for s, copies in side.items():
            reference = add()
            reference.setSpecies(species[s])
            reference.setStoichiometry(float(copies))
            reference.setConstant(True)
    rate = float(network.known_rates[r] * network.ways[r])
    needed = {PLACE.format(i): copies for i, copies in enumerate(before.values())}
    formula = _formula(_propensity(rate, needed, network.combinations), [species[s] for s in before])
    if formula is None:  # a factorial beyond all floats
        raise ValueError(
            f"channel {name!r} needs {max(needed.values())} copies of one species, too many for a formula of SBML; "
            f"write the reaction in steps of fewer reactants"
        )
    reaction.createKineticLaw().setMath(formula)


def _formula(text: str, ids: Sequence[str]) -> Any | None:
    """A formula in which `PLACE` number i is the i-th id. None for what is no formula.

    The ids go around the grammar of texts, which takes `Pi`, `inf` or `Time`, in any case, for constants.
    """
    made = libsbml.parseL3Formula(text)
    named = {PLACE.format(i): key for i, key in enumerate(ids)}
    for part in parts_of(made) if made else ():
        if part.getType() == libsbml.AST_NAME:
            part.setName(named[part.getName()])
    return made


def _propensity(rate: float, needed: Mapping[str, int], combinations: str) -> str:
    """Rate times combinations, in the grammar of Level 3 formulas."""
    if combinations == "product":
        law = " * ".join([repr(rate), *(f"{name}^{copies}" for name, copies in needed.items())])
        enough = [f"{name} >= {copies}" for name, copies in needed.items() if copies > 1]
        return f"piecewise({law}, {' && '.join(enough)}, 0)" if enough else law
    factors = [repr(rate)]
    for name, copies in needed.items():
        factors += [name, *(f"({name} - {i})" for i in range(1, copies))]
        if copies > 1 and combinations == "distinct":
            factors[-1] += f" / {factorial(copies)}"
    return " * ".join(factors)


def _shown(name: str) -> str:
    """A name as libsbml takes it: it lets what looks like an entity pass, and ends the process on a last `&#`."""
    one_line = BREAKS.sub(" ", name)
    check_visible("a file of SBML cannot have a name", one_line)
    return one_line.replace("&", "&amp;")


def _id(name: str) -> str:
    key = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return key if re.match(r"[A-Za-z_]", key) else f"_{key}"
