"""The format of reactions as people write them, .rxn: what `Network.from_text` reads, with observables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from kinetics.formats.base import Format
from kinetics.formats.massaction import linear_weights
from kinetics.formats.scaling import model_of
from kinetics.network import Model, Network
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Graph
from kinetics.network.laws.reading import node_of
from kinetics.network.laws.writing import quoted
from kinetics.network.network import network_of
from kinetics.network.parameters import number_of
from kinetics.network.reaction_text import SETTINGS, read_reactions
from kinetics.network.reactions import sides_of
from kinetics.network.text_events import UNNAMED, event_text
from kinetics.network.text_names import MOST_COPIES
from kinetics.support.limits import MOST_SPECIES, check_count, check_names, text_in

MAX_BYTES = 32 * 2**20
WIDTH = 100  # of a line of species


@dataclass(frozen=True)
class ReactionLines(Format):
    """The reader and writer of reactions as lines of text."""

    name: ClassVar[str] = "rxn"
    suffixes: ClassVar[tuple[str, ...]] = (".rxn",)

    def read(self, path: Path, copies_per_unit: float | None = None) -> Model:
        """The file's network with its parameters, its counts and its observables."""
        text = text_in(path, MAX_BYTES)
        try:
            read = read_reactions(text)
            check_count(path, "species", len(read.species), MOST_SPECIES)
            check_names(path, read.species)
            if copies_per_unit is None:
                read.check_events()
            elif read.notes:
                raise ValueError("its volume says how many copies its amounts are; leave out the copies per unit")
            network = network_of(read)
            sums = {name: _weights(name, formula, network.species) for name, formula in read.observables.items()}
            given = network.given
            amounts = {
                name: number_of(f"count of {name!r}", amount, given.values)
                if isinstance(amount, Expression)
                else amount
                for name, amount in (dict.fromkeys(network.species, 0) | dict(given.initial)).items()
            }
            return model_of(path, network, amounts, copies_per_unit, sums, read.notes)
        except ValueError as error:
            raise error if str(path) in str(error) else ValueError(f"{path}, {error}") from None

    def text(self, model: Model) -> str:
        """The model as lines, parameters and formulas with their names; a ValueError for what no line can say."""
        return "\n".join(_lines(model)) + "\n"


def _weights(name: str, formula: Expression, species: Sequence[str]) -> Mapping[str, float]:
    found = linear_weights(formula.with_numbers().formula, species)
    if found is None:
        raise ValueError(f"observable {name!r} is {formula}; expected a sum of counts, such as A + 2 * AB")
    return found


def _lines(model: Model) -> list[str]:
    network = model.network
    if network.laws and network.at_zero != "block":
        raise ValueError(
            f"in a file of reactions a law waits for its reactants; at_zero={network.at_zero!r} does not fit"
        )
    given = network.given
    kept = _used(network)
    lines = [f"time unit: {' '.join(network.time_unit.split())}"] if network.time_unit.strip() else []
    lines += [f"combinations: {network.combinations}"] if network.combinations != "distinct" else []
    for name in kept:
        lines.append(f"{quoted(name)} = {_text(given.given[name], given.given)}")
    lines += _species_lines([quoted(name) for name in network.species])
    for name, count in zip(network.species, model.initial.tolist(), strict=True):
        amount = given.initial.get(name, count)
        is_formula = isinstance(amount, Expression) and bool(amount.parameters)
        if is_formula and given.count(name) == count:
            lines.append(f"{quoted(name)} = {_text(amount, given.given)}")
        elif count:
            lines.append(f"{quoted(name)} = {count}")
    lines += [_reaction_line(network, r) for r in range(len(network.channels))]
    for place, event in enumerate(network.events, 1):
        label = "" if event.name == UNNAMED.format(place) else f"{_label(event.name)}: "
        lines.append(label + event_text(event, lambda formula: _text(formula, given.given)))
    for name, weights in model.observables.items():
        terms = [quoted(each) if w == 1 else f"{float(w)!r} * {quoted(each)}" for each, w in weights.items()]
        lines.append(f"observable: {quoted(name)} = {' + '.join(terms) or '0'}")
    return lines


def _used(network: Network) -> list[str]:
    """The parameters that something is a formula of: others would be taken for a slip of the pen."""
    given = network.given
    formulas = [*network.laws.values(), *given.rates.values()]
    for event in network.events:
        formulas += [event.condition, event.waits, *event.new_counts.values()]
    found = {name for each in formulas for name in each.parameters}
    found |= {name for each in given.initial.values() if isinstance(each, Expression) for name in each.parameters}
    for name, each in reversed([*given.given.items()]):
        if name in found and isinstance(each, Expression):
            found |= each.parameters.keys()
    return [name for name in given.given if name in found]


def _species_lines(names: Sequence[str]) -> list[str]:
    lines, line = [], ""
    for name in names:
        if line and len(line) + len(name) > WIDTH:
            lines.append(line)
            line = ""
        line = f"{line}, {name}" if line else f"species: {name}"
    return [*lines, line]


def _reaction_line(network: Network, r: int) -> str:
    name = network.channels[r]
    sides = sides_of(network.sparse_reactants, network.sparse_stoichiometry, r)
    if any(copies > MOST_COPIES for side in sides for copies in side.values()):
        raise ValueError(f"channel {name!r} has over {MOST_COPIES} copies of one species in one place")
    before, after = (
        " + ".join(
            quoted(network.species[s]) if n == 1 else f"{n} {quoted(network.species[s])}" for s, n in side.items()
        )
        or "0"
        for side in sides
    )
    ways, k = float(network.ways[r]), float(network.known_rates[r])
    law = network.laws.get(name)
    if law is None:
        rate = _text(network.given.rates.get(name, k), network.given.given)
        rate = rate if ways == 1 else f"{ways!r} * ({rate})"
    else:
        rate = _text(law, network.given.given)
        if not law.species and not law.reads_time:
            raise ValueError(f"the law of channel {name!r} is {law}, which reads no counts: it would be mass action")
        rate = rate if ways * k == 1 else f"{ways!r} * {k!r} * ({rate})"
    return f"{_label(name)}: {before} -> {after}, {rate}"


def _label(name: str) -> str:
    return repr(name) if name in SETTINGS else quoted(name)


def _text(formula: float | Expression, parameters: Mapping[str, float | Expression]) -> str:
    """A formula in terms of these parameters, with numbers in place of others."""
    if not isinstance(formula, Expression):
        return repr(float(formula))
    text = formula.with_numbers(parameters).text
    try:
        node_of(text, Graph())
    except ValueError as error:
        raise ValueError(f"the formula {formula} is too long for one line of text: {error}") from None
    return text
