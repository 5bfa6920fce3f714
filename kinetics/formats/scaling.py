"""The scale of a model: how many copies one unit of a file's amounts is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinetics.formats.base import CLOSE
from kinetics.network import Model, Network
from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code, Graph
from kinetics.network.laws.reading import written


def model_of(
    path: Path,
    network: Network,
    amounts: Mapping[str, float],
    copies_per_unit: float | None,
    observables: Mapping[str, Mapping[str, float]],
    notes: Sequence[str] = (),
    formulas: Mapping[str, str] | None = None,
) -> Model:
    """The model of a file whose network and amounts at time 0 are in its own units.

    copies_per_unit : None for a unit that is a copy; fractions of a copy are then refused, with a hint to give it
    """
    scale = 1.0 if copies_per_unit is None else copies_per_unit
    if not (math.isfinite(scale) and scale > 0):
        raise ValueError(f"{scale} copies per unit; expected a finite number above 0")
    counts = {name: amount if scale == 1 else amount * scale for name, amount in amounts.items()}
    for name, count in counts.items():
        if not 0 <= count < 2.0**63:  # nan, too
            raise ValueError(f"{path}: {count:g} copies of {name!r}; expected a count from 0 to 2**63 - 1")
    off = [name for name, count in counts.items() if not is_count(count)]
    remarks = list(notes)
    if off and copies_per_unit is None:
        more = f" and so do {len(off) - 1} more" if len(off) > 1 else ""
        raise ValueError(
            f"{path}: {off[0]!r} starts from {counts[off[0]]:g}{more}, which is not a whole number of copies; state "
            f"the copies in one unit of amount, as by --copies-per-unit 1e6 or read(path, copies_per_unit=1e6)"
        )
    if off:
        more = f" and {len(off) - 1} more" if len(off) > 1 else ""
        remarks.append(f"rounded {counts[off[0]]:g} copies of {off[0]}{more}")
    if scale != 1:
        remarks.append(f"one unit of the file's amounts is {scale:g} copies")
        network = scaled(network, scale)
    whole = np.array([round(count) for count in counts.values()], dtype=np.int64)
    stated = dict(zip(counts, whole.tolist(), strict=True))
    formulas_of = {name: each for name, each in network.given.initial.items() if isinstance(each, Expression)}
    network = replace(network, given=replace(network.given, initial=stated | formulas_of))
    return Model(network, whole, observables, tuple(remarks), formulas or {})


def is_count(amount: float) -> bool:
    """Whether an amount is a whole number of copies that a count can hold, except for its rounding."""
    return 0 <= amount < 2.0**63 and abs(amount - round(amount)) <= CLOSE * amount


def scaled(network: Network, copies: float) -> Network:
    """A network over amounts as one over counts, `copies` to a unit: the same rate equations, less noise.

    Mass action of order n has its rate constant times copies**(1 - n); laws, conditions and new counts read amounts.
    """
    order = np.bincount(network.sparse_reactants.rows, network.sparse_reactants.copies, len(network.channels))
    is_law = np.isin(network.channels, list(network.laws))
    factors = copies ** np.where(is_law, 0.0, 1.0 - order)
    rates = {name: _times(k, factors[network.channel_places[name]]) for name, k in network.given.rates.items()}
    initial = {
        name: _whole(amount, copies) for name, amount in network.given.initial.items() if isinstance(amount, Expression)
    }
    return replace(
        network,
        rate_constants=network.known_rates * factors,
        laws={name: _law(law, copies) for name, law in network.laws.items()},
        events=tuple(_event(event, copies) for event in network.events),
        given=replace(network.given, rates=rates, initial=initial),
        crowding=None,  # its laws are among the others
    )


def _law(law: Expression, copies: float) -> Expression:
    return _times(_over_counts(law, copies), copies)


def _times(formula: Expression, factor: float) -> Expression:
    """A formula times a number."""
    graph = Graph(most=3 * len(formula.formula) + 10)
    place = graph.copied(formula.formula)[-1]
    whole = place if factor == 1 else graph.add(Code.MULTIPLY, (graph.number(factor), place))
    return Expression.of(graph.formula(whole), formula.parameters)


def _whole(amount: Expression, copies: float) -> Expression:
    """An amount as the nearest whole number of copies."""
    graph = Graph(most=10 * len(amount.formula) + 100)
    place = graph.copied(amount.formula)[-1]
    whole = written("floor(unit * amount + 0.5)", graph, unit=graph.number(copies), amount=place)
    return Expression.of(graph.formula(whole), amount.parameters)


def _event(event: Event, copies: float) -> Event:
    new = {name: _whole(_over_counts(value, copies), copies) for name, value in event.new_counts.items()}
    delay = _over_counts(event.waits, copies)
    return replace(event, when=_over_counts(event.condition, copies), assign=new, delay=delay)


def _over_counts(formula: Expression, copies: float) -> Expression:
    """A formula over amounts with count / copies in place of every amount."""
    graph = Graph(most=10 * len(formula.formula) + 100)
    unit = graph.number(copies)
    amounts = {name: graph.add(Code.DIVIDE, (graph.name(name), unit)) for name in formula.species}
    place = graph.copied(formula.formula, amounts)[-1]
    return Expression.of(graph.formula(place), formula.parameters)
