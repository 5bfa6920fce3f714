"""The reactions of SBML files as channels: whole copies on both sides, one direction each, a constant or a law."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from kinetics.formats.directions import directions_of, is_0_without, is_never_below_0, is_seen_below_0
from kinetics.formats.massaction import constant_formula, rate_constant
from kinetics.formats.sbmlnames import SbmlNames
from kinetics.network.laws.expression import Expression
from kinetics.network.reactions import Reaction

MOST_COPIES = 10**6  # in one place of a reaction
BACKWARD = "{} backward"  # name of the second direction's channel: no id of SBML has a space


@dataclass(frozen=True)
class Channels:
    """The channels of a file: name -> reaction, their rates or laws, and remarks on them."""

    reactions: dict[str, Reaction]
    laws: list[float | Expression]
    notes: list[str]
    formulas: dict[str, Expression] = field(default_factory=dict)  # of the rate constants


def channels_of(names: SbmlNames) -> Channels:
    """The channels of all reactions; a ValueError for a law that two directions share in no form that shows them."""
    made = Channels({}, [], [])
    states = set(names.states)
    held = {name for name, each in names.species.items() if each.getBoundaryCondition() or each.getConstant()}
    held |= names.numbers.keys()
    for reaction in names.reactions.values():
        key = reaction.getId()
        if reaction.isSetFast() and reaction.getFast():
            raise names.wrong(reaction, f"reaction {key!r} is `fast`, which has no stochastic meaning")
        law = names.expression(names.law(reaction))
        before, after = (
            _side(names, reaction, getattr(reaction, f"getListOf{side}")()) for side in ("Reactants", "Products")
        )
        # What is held is neither taken nor made.
        taken, gained = ({name: n for name, n in side.items() if n and name not in held} for side in (before, after))
        for name in (taken | gained).keys() - states:
            raise names.wrong(reaction, f"reaction {key!r} changes {name!r}, which a rule gives")
        forward, backward = _directions(names, reaction, law, taken, gained, made.notes)
        if forward is not None:
            _add(made, key, forward, taken, gained)
        if backward is not None:
            _add(made, BACKWARD.format(key), backward, gained, taken)
    return made


def _directions(
    names: SbmlNames,
    reaction: Any,
    law: Expression,
    taken: Mapping[str, int],
    gained: Mapping[str, int],
    notes: list[str],
) -> tuple[Expression | None, Expression | None]:
    """The laws of a reaction's two directions; None for one that it does not have."""
    key, alone = reaction.getId(), (law, None)
    if rate_constant(law, {}) is not None or is_never_below_0(law, taken):
        return alone
    if is_seen_below_0(law):
        found = directions_of(law)
        if reaction.getReversible() and found is not None:
            if found[1] is not None:
                notes.append(f"{key} is reversible: {found[0] or 0} forward, {found[1]} backward")
            return found
        net = [name for name, copies in gained.items() if copies > taken.get(name, 0)]
        is_two_way = found is not None and found[1] is not None and bool(net) and is_0_without(found[1], net)
        if reaction.getReversible() or is_two_way:
            why = (
                "is not reversible, but its law has both directions"
                if is_two_way
                else "is reversible, and its law is no difference of two parts of at least 0"
            )
            raise names.wrong(
                reaction, f"reaction {key!r} {why}: {law}; write it as two reactions, one for each direction"
            )
    notes.append(f"the law of {key} is not proven to be at least 0; a run in which it is negative ends with an error")
    return alone


def _add(made: Channels, name: str, law: Expression, taken: dict[str, int], gained: dict[str, int]) -> None:
    """One direction as a channel, with a plain rate constant if its law is mass action."""
    lost = {species: max(0, copies - gained.get(species, 0)) for species, copies in taken.items()}
    found = rate_constant(law, lost)
    if found is None:
        made.laws.append(law)
        made.reactions[name] = (taken, gained)
        return
    k, needed = found
    made.laws.append(k)
    if law.parameters:
        made.formulas[name] = constant_formula(law)
    net = {each: gained.get(each, 0) - taken.get(each, 0) for each in needed | taken | gained}
    made.reactions[name] = (needed, {each: needed.get(each, 0) + gain for each, gain in net.items()})


def _side(names: SbmlNames, reaction: Any, references: Any) -> dict[str, int]:
    """Copies of each species on one side of a reaction."""
    copies: dict[str, int] = {}
    for i in range(references.size()):
        reference = references.get(i)
        species = reference.getSpecies()
        n = _stoichiometry(names, reaction, reference) * _conversion(names, species)
        whole = round(n) if abs(n) <= MOST_COPIES else -1
        if whole < 0 or abs(n - whole) > 1e-12 * max(1.0, n):
            raise names.wrong(
                reference,
                f"reaction {reaction.getId()!r} has {n:g} of {species!r}; expected whole copies, at most {MOST_COPIES}",
            )
        copies[species] = copies.get(species, 0) + whole
    return copies


def _stoichiometry(names: SbmlNames, reaction: Any, reference: Any) -> float:
    """The number that a reference states, or that its rule, assignment or formula comes to at all times."""
    key, place = reference.getId(), None
    if key and (key in names.rules or key in names.assignments):
        place = names.meaning(key)
    elif reference.isSetStoichiometryMath() and reference.getStoichiometryMath().isSetMath():
        place = names.node(reference, reference.getStoichiometryMath().getMath())
    if place is None:
        # The first is nan if Level 3 states none, the second is 1 beyond Level 2.
        return float(reference.getStoichiometry() / reference.getDenominator())
    number = names.constant(place)
    if number is None:
        raise names.wrong(
            reference,
            f"reaction {reaction.getId()!r} has {names.expression(place)} of {reference.getSpecies()!r}, which changes "
            f"with counts or time; expected a number of copies",
        )
    return number


def _conversion(names: SbmlNames, species: str) -> float:
    """Amount of a species that one extent of a reaction stands for."""
    owner = names.species[species]
    owner = owner if owner.isSetConversionFactor() else names.source
    if not owner.isSetConversionFactor():
        return 1.0
    names.settled.add(owner.getConversionFactor())
    return names.initial(owner.getConversionFactor())
