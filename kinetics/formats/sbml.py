"""The format SBML, Levels 2 and 3, read by libsbml as a stochastic model: amounts are copies.

Kinetic laws that are mass action become plain rate constants, for the quick methods; all others are kept as written. A
reversible reaction becomes two channels. What has no counterpart here is refused by name. Hucka et al. (2019).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from kinetics.formats.massaction import linear_weights
from kinetics.formats.model import Format, NetworkModel
from kinetics.formats.sbmlevents import events_of
from kinetics.formats.sbmlfile import document_of
from kinetics.formats.sbmlmath import is_sum
from kinetics.formats.sbmlnames import SbmlError, SbmlNames
from kinetics.formats.sbmlreactions import channels_of
from kinetics.formats.sbmlwriting import sbml_text
from kinetics.formats.scaling import model_of
from kinetics.network import Network


@dataclass(frozen=True)
class Sbml(Format):
    """The reader and writer of SBML files."""

    name: ClassVar[str] = "sbml"
    suffixes: ClassVar[tuple[str, ...]] = (".xml", ".sbml")

    def read(self, path: Path, copies_per_unit: float | None = None) -> NetworkModel:
        """The file's network with `distinct` combinations, its counts, and what its rules add up."""
        document = document_of(path)  # its model lives as long as it does
        names = SbmlNames(path, document.getModel())
        try:
            return _model(names, copies_per_unit)
        except RecursionError:
            raise ValueError(f"{path}: formulas are nested too deeply; write them with fewer terms") from None
        except ValueError as error:
            raise error if str(path) in str(error) else ValueError(f"{path}: {error}") from None

    def text(self, model: NetworkModel) -> str:
        """The model in Level 3 Version 1, amounts in copies."""
        return sbml_text(model)


def _model(names: SbmlNames, copies_per_unit: float | None) -> NetworkModel:
    """The model as a network of ours."""
    _check_scope(names)
    if not names.states:
        raise names.wrong(names.source, "no species whose amount reactions or events could change")
    amounts = {name: names.initial_amount(name) for name in names.states}
    channels, events = channels_of(names), events_of(names)
    network = Network.from_reactions(channels.reactions, channels.laws, names.states, events=events)
    sums, notes = {}, list(channels.notes)
    if copies_per_unit is None and _are_moles(names):
        notes.append("the file states amounts in moles; they are read as copies")
    for name, rule in names.rules.items():
        if name in names.species or name in names.parameters:
            weights = _weights(names, name, rule, network.species)
            if weights is None:
                notes.append(f"{name} is no sum of counts and is not shown")
            else:
                sums[name] = weights
    return model_of(names.path, network, amounts, copies_per_unit, sums, notes, _formulas(names))


def _check_scope(names: SbmlNames) -> None:
    """Refuse what has no counterpart: it would be left out in silence."""
    for rule in names.each("Rules"):
        if not rule.isAssignment() and rule.isSetMath():
            kind = "a rate rule" if rule.isRate() else "an algebraic rule"
            raise names.wrong(rule, f"{kind}: counts change by reactions and events only")
    for constraint in names.each("Constraints"):
        raise names.wrong(constraint, "a constraint: runs are not stopped by conditions")


def _are_moles(names: SbmlNames) -> bool:
    """Whether the model, or a species of a state, states moles as the unit of its amounts."""
    import libsbml

    stated = {names.source.getSubstanceUnits(), *(names.species[name].getSubstanceUnits() for name in names.states)}
    defined = {each.getId(): each for each in names.each("UnitDefinitions")}
    units = [defined[unit].getUnit(i) for unit in stated & defined.keys() for i in range(defined[unit].getNumUnits())]
    return "mole" in stated or any(unit.getKind() == libsbml.UNIT_KIND_MOLE for unit in units)


def _weights(names: SbmlNames, key: str, rule: Any, species: tuple[str, ...]) -> dict[str, float] | None:
    """Weights of a sum of amounts, term by term, however long it is; None for any other formula."""
    total: dict[str, float] = {}
    size = names.constant(rule, names.size(key)) if key in names.species else 1.0
    waiting = [rule.getMath()]
    while waiting:
        term = waiting.pop()
        if is_sum(term):
            waiting += [term.getChild(i) for i in reversed(range(term.getNumChildren()))]
            continue
        try:
            part = linear_weights(names.expression(rule, names.text(rule, term)), species)
        except SbmlError as error:
            if not error.is_too_long:
                raise
            part = None
        if part is None or size is None:
            return None
        for name, weight in part.items():
            total[name] = total.get(name, 0.0) + weight * size
    return total


def _formulas(names: SbmlNames) -> dict[str, str]:
    """What every id with a value stands for, but for formulas that are too long."""
    made = {}
    for name in (*names.compartments, *names.species, *names.parameters, *names.references):
        try:
            made[name] = names.meaning(name)
        except SbmlError as error:
            if not error.is_too_long:
                raise
        except ValueError:  # an id without a value, which nothing uses
            continue
    return made
