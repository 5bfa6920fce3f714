"""The writer of SBML files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from kinetics.formats.sbmlformulas import tree_of
from kinetics.formats.sbmlpropensities import Formulas
from kinetics.network import Model, Network
from kinetics.network.checks import spelled_apart
from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code, Graph
from kinetics.network.reactions import sides_of
from kinetics.support.limits import BREAKS, check_visible
from kinetics.support.packages import libsbml


def sbml_text(model: Model) -> str:
    """The model in Level 3 Version 1: one volume of size 1, amounts in copies, observables as assignment rules, events.

    Parameters that are plain numbers keep their names; those that are formulas are written out where they are used.
    Names that no id can have are kept as names, beside an id with _ for the characters in question.
    """
    network = model.network
    if network.laws and network.at_zero != "block":
        raise ValueError(f"in an SBML file a law waits for its reactants; at_zero={network.at_zero!r} does not fit")
    document = libsbml.SBMLDocument(3, 1)
    made = document.createModel()
    made.setSubstanceUnits("item")
    made.setExtentUnits("item")
    formulas = Formulas(network)
    names = ["tank", *network.species, *network.channels, *model.observables, *(each.name for each in network.events)]
    names += formulas.parameters
    ids = iter(spelled_apart(names, _id))
    place = made.createCompartment()
    place.setId(next(ids))
    place.setConstant(True)
    place.setSize(1.0)
    place.setSpatialDimensions(3.0)
    species = {name: next(ids) for name in network.species}
    channels = [next(ids) for _ in network.channels]
    observables = [next(ids) for _ in model.observables]
    events = [next(ids) for _ in network.events]
    known = species | {name: next(ids) for name in formulas.parameters}
    for (name, key), count in zip(species.items(), model.initial.tolist(), strict=True):
        each = made.createSpecies()
        each.setId(key)
        each.setName(_shown(name))
        each.setCompartment(place.getId())
        if float(f"{count:.15g}") != count:
            raise ValueError(f"{count} copies of {name!r}: libsbml writes 15 digits; expected a count with no more")
        each.setInitialAmount(float(count))
        each.setHasOnlySubstanceUnits(True)
        each.setBoundaryCondition(False)
        each.setConstant(False)
    for name in formulas.parameters:
        parameter = made.createParameter()
        parameter.setId(known[name])
        parameter.setName(_shown(name))
        parameter.setConstant(True)
        parameter.setValue(network.parameters[name])
    for r, key in enumerate(channels):
        _add_reaction(made.createReaction(), key, network, r, known, formulas)
    for (name, weights), key in zip(model.observables.items(), observables, strict=True):
        parameter = made.createParameter()
        parameter.setId(key)
        parameter.setName(_shown(name))
        parameter.setConstant(False)
        rule = made.createAssignmentRule()
        rule.setVariable(key)
        rule.setMath(tree_of(_sum(weights), species))
    for event, key in zip(network.events, events, strict=True):
        _add_event(made.createEvent(), key, event, known, formulas)
    return str(libsbml.writeSBMLToString(document))


def _add_event(made: Any, key: str, event: Event, ids: Mapping[str, str], formulas: Formulas) -> None:
    made.setId(key)
    made.setName(_shown(event.name))
    made.setUseValuesFromTriggerTime(event.from_trigger)
    trigger = made.createTrigger()
    trigger.setInitialValue(event.was_true)
    trigger.setPersistent(event.persistent)
    trigger.setMath(tree_of(formulas.plain(event.condition), ids, is_condition=True))
    if event.is_delayed:
        made.createDelay().setMath(tree_of(formulas.plain(event.waits), ids))
    if event.priority:
        made.createPriority().setMath(tree_of(Expression(repr(event.priority)), ids))
    for name, formula in event.new_counts.items():
        assignment = made.createEventAssignment()
        assignment.setVariable(ids[name])
        assignment.setMath(tree_of(formulas.plain(formula), ids))


def _add_reaction(made: Any, key: str, network: Network, r: int, ids: Mapping[str, str], formulas: Formulas) -> None:
    made.setId(key)
    made.setName(_shown(network.channels[r]))
    made.setReversible(False)
    made.setFast(False)
    before, after = sides_of(network.sparse_reactants, network.sparse_stoichiometry, r)
    for side, add in ((before, made.createReactant), (after, made.createProduct)):
        for s, copies in side.items():
            reference = add()
            reference.setSpecies(ids[network.species[s]])
            reference.setStoichiometry(float(copies))
            reference.setConstant(True)
    formula = formulas.propensity(r)
    for name in formula.species:
        if network.species_places[name] not in before.keys() | after.keys():
            made.createModifier().setSpecies(ids[name])
    made.createKineticLaw().setMath(tree_of(formula, ids))


def _sum(weights: Mapping[str, float]) -> Expression:
    graph = Graph()
    terms = [
        graph.name(name) if w == 1 else graph.add(Code.MULTIPLY, (graph.number(w), graph.name(name)))
        for name, w in weights.items()
    ]
    return Expression.of(graph.formula(graph.all_of(Code.ADD, terms) if terms else graph.number(0.0)))


def _shown(name: str) -> str:
    """A name as libsbml takes it: it lets what looks like an entity pass, and ends the process on a last `&#`."""
    one_line = BREAKS.sub(" ", name)
    check_visible("a file of SBML cannot have a name", one_line)
    return one_line.replace("&", "&amp;")


def _id(name: str) -> str:
    key = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return key if re.match(r"[A-Za-z_]", key) else f"_{key}"
