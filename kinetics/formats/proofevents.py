"""Events of a network as numbers at a state, so that those of a file read back can be compared with them."""

from __future__ import annotations

from operator import itemgetter

import numpy as np

from kinetics.network import Network
from kinetics.network.laws.events import Event
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code, Graph
from kinetics.network.laws.program import evaluate, steps_of
from kinetics.support.arrays import Floats, Ints

COMPARING = (Code.LESS, Code.LESS_EQUAL, Code.EQUAL, Code.NOT_EQUAL)
MADE = {Code.AND: Code.ADD, Code.OR: Code.SUBTRACT, Code.NOT: Code.NEGATE}
WEIGHT = 3.0  # of the second part, so that an exchange of both is seen


def event_numbers(network: Network, state: Ints, time: float) -> tuple[tuple[str, ...], Floats]:
    """All that events do at a state (S,) and a time, and of each number the name of its event.

    Flags, priority, places of the species set, whether the condition holds and by how much, delay and new counts.
    """
    names: list[str] = []
    values: list[float] = []
    for event in network.events:
        new = sorted(
            ((network.species_places[name], formula) for name, formula in event.new_counts.items()), key=itemgetter(0)
        )
        formulas = [event.condition, _margin(event), event.waits, *(formula for _, formula in new)]
        own = [event.was_true, event.from_trigger, event.persistent, event.priority, *(place for place, _ in new)]
        own += [_value(each, network, state, time) for each in formulas]
        names += [event.name] * len(own)
        values += map(float, own)
    return tuple(names), np.array(values)


def _value(formula: Expression, network: Network, state: Ints, time: float) -> float:
    return float(evaluate(steps_of(formula, network.species_places), state, time))


def _margin(event: Event) -> Expression:
    """How far its comparisons are from turning, in one number: t >= 20 and t >= 21 hold at the same few times."""
    nodes, read = event.condition.formula, event.condition.parameters
    graph = Graph(most=10 * len(nodes) + 100)
    places = graph.copied(nodes)
    outer = {len(nodes) - 1}
    for place in range(len(nodes) - 1, -1, -1):  # wholes before parts
        if place in outer and nodes[place].code in MADE:
            outer.update(nodes[place].parts)
    for place, (code, parts, _) in enumerate(nodes):
        if place not in outer or code not in (*MADE, *COMPARING):
            continue
        inner = [places[part] for part in parts]
        if code in MADE:
            inner[1:] = [graph.add(Code.MULTIPLY, (graph.number(WEIGHT), each)) for each in inner[1:]]
        made = graph.add(MADE.get(code, Code.SUBTRACT), inner)
        # The kind of the comparison counts too: < and <= differ where both sides are equal alone.
        places[place] = made if code in MADE else graph.add(Code.MULTIPLY, (graph.number(float(code)), made))
    return Expression.of(graph.formula(places[-1]), read)
