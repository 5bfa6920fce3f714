"""The format SBML, Levels 2 and 3, read by libsbml as a stochastic model: amounts are copies.

Kinetic laws that are mass action become plain rate constants, for the quick methods; all others are kept as written. A
reversible reaction becomes two channels. What has no counterpart here is refused by name. Hucka et al. (2019).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from kinetics.formats.base import Format
from kinetics.formats.massaction import linear_weights
from kinetics.formats.sbmlevents import events_of
from kinetics.formats.sbmlfile import document_of
from kinetics.formats.sbmlnames import SbmlNames
from kinetics.formats.sbmlreactions import channels_of
from kinetics.formats.sbmlwriting import sbml_text
from kinetics.formats.scaling import model_of
from kinetics.network import Model, Network
from kinetics.network.laws.graph import BudgetError
from kinetics.network.parameters import Parameters
from kinetics.support.limits import XML_BYTES, bytes_in
from kinetics.support.packages import libsbml


@dataclass(frozen=True)
class Sbml(Format):
    """The reader and writer of SBML files."""

    name: ClassVar[str] = "sbml"
    suffixes: ClassVar[tuple[str, ...]] = (".xml", ".sbml")

    def read(self, path: Path, copies_per_unit: float | None = None) -> Model:
        """The file's network with `distinct` combinations, its counts, and what its rules add up."""
        return model_in(path, bytes_in(path, XML_BYTES), copies_per_unit)

    def text(self, model: Model) -> str:
        """The model in Level 3 Version 1, amounts in copies."""
        return sbml_text(model)


def model_in(path: Path, data: bytes, copies_per_unit: float | None) -> Model:
    """The model of a document; `path` is the user's file, for messages."""
    try:
        document = document_of(path, data)  # its model lives as long as it does
        return _model(SbmlNames(path, document.getModel(), len(data), copies_per_unit), copies_per_unit)
    except ValueError as error:
        raise error if str(path) in str(error) else ValueError(f"{path}: {error}") from None


def _model(names: SbmlNames, copies_per_unit: float | None) -> Model:
    """The model as a network of ours."""
    _check_scope(names)
    if not names.states:
        raise names.wrong(names.source, "no species whose amount reactions or events could change")
    amounts = {name: names.initial_amount(name) for name in names.states}
    channels, events = channels_of(names), events_of(names)
    network = Network.from_reactions(
        channels.reactions, channels.laws, names.states, events=events, time_unit=_time_unit(names)
    )
    sums, notes, is_spent = {}, list(channels.notes), False
    notes += [
        f"nothing changes {name}; its value, {amount:g} in the file, is read as a number, not a count"
        for name, amount in names.numbers.items()
    ]
    if copies_per_unit is None and _are_moles(names):
        notes.append("the file states amounts in moles; they are read as copies")
    for name in names.rules:
        names.meaning(name)  # of all, before any is handed out: a sum beyond the budget is only not shown
    for name in names.rules:
        if name in names.species or name in names.parameters:
            try:
                weights = None if is_spent else _weights(names, name, network.species)
            except BudgetError:
                weights, is_spent = None, True
            if weights is None:
                notes.append(f"{name} is not a sum of counts and is not shown")
            else:
                sums[name] = weights
    open_to_change = {name: value for name, value in names.values.items() if name not in names.settled}
    network = replace(network, given=Parameters(open_to_change, channels.formulas))
    return model_of(names.path, network, amounts, copies_per_unit, sums, notes, _formulas(names))


def _check_scope(names: SbmlNames) -> None:
    """ValueError for content without a counterpart, which would be left out silently."""
    for rule in names.each("Rules"):
        if not rule.isAssignment() and rule.isSetMath():
            kind = "a rate rule" if rule.isRate() else "an algebraic rule"
            raise names.wrong(rule, f"{kind}: counts may change by reactions and events only")
    for constraint in names.each("Constraints"):
        raise names.wrong(constraint, "a constraint: runs are not stopped by conditions")


def _are_moles(names: SbmlNames) -> bool:
    """Whether the model, or a species of a state, states moles as the unit of its amounts."""
    stated = {names.source.getSubstanceUnits(), *(names.species[name].getSubstanceUnits() for name in names.states)}
    defined = {each.getId(): each for each in names.each("UnitDefinitions")}
    units = [defined[unit].getUnit(i) for unit in stated & defined.keys() for i in range(defined[unit].getNumUnits())]
    return "mole" in stated or any(unit.getKind() == libsbml.UNIT_KIND_MOLE for unit in units)


def _time_unit(names: SbmlNames) -> str:
    """The model's unit of time, as it names it; `s` for a second, and "" where it states none."""
    unit: str = names.source.getTimeUnits()
    defined = {each.getId(): each.getName() for each in names.each("UnitDefinitions")}
    return {"second": "s", "dimensionless": ""}.get(unit, defined.get(unit) or unit)


def _weights(names: SbmlNames, key: str, species: tuple[str, ...]) -> dict[str, float] | None:
    """Weights of a rule that is a sum of amounts; None for any other."""
    size = names.constant(names.size(key)) if key in names.species else 1.0
    formula = names.expression(names.meaning(key))
    found = linear_weights(formula.with_numbers().formula, species)
    if found is None or size is None:
        return None
    names.settled.update(formula.parameters)
    return {name: weight * size for name, weight in found.items()}


def _formulas(names: SbmlNames) -> dict[str, str]:
    """Id -> its formula, within the budget."""
    made = {}
    for name in (*names.compartments, *names.species, *names.parameters, *names.references):
        try:
            made[name] = names.expression(names.meaning(name)).with_numbers().text
        except BudgetError:
            break
        except ValueError:  # an id without a value, which nothing uses
            continue
    return made
