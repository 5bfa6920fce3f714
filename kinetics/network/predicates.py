"""Conditions on counts as text, such as `quadmer >= 1 and monomer == 0` or `"done" | !(A > 3)`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinetics.network.checks import some_names
from kinetics.network.laws.enclosure import enclosed
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import TRUTHS, Code, Graph, Node
from kinetics.network.laws.program import evaluate, steps_of
from kinetics.network.laws.reading import OURS, Dialect, node_of, shortened
from kinetics.network.laws.writing import text_of
from kinetics.network.model import Model
from kinetics.network.network import Network
from kinetics.network.sums import summed
from kinetics.support.arrays import Floats, Ints

PRISM = Dialect(
    spellings={"&": "and", "|": "or", "!": "not", "=": "=="},
    constants={**OURS.constants, "true": lambda graph: _truth(graph, 1.0), "false": lambda graph: _truth(graph, 0.0)},
    implies=True,
)


INIT, DEADLOCK = "init", "deadlock"  # labels of every chain, as PRISM calls them
BLOCK = 10**6  # propensities at a time
LOST = 1e-6  # relative error of a formula beyond which it is refused


class StateNames:
    """The names that a condition may use: variables, whose values are counts, and labels, which are true or false.

    counts : (N, V) of every state
    labels : name -> (N,) bool
    """

    def __init__(
        self, n_states: int, variables: Sequence[str], counts: Ints | None, labels: Mapping[str, NDArray[np.bool_]]
    ) -> None:
        self.n_states, self.labels = n_states, labels
        self.variables = {name: place for place, name in enumerate(variables)}
        self.counts = np.empty((n_states, 0), dtype=np.int64) if counts is None else counts

    def holds(self, text: str) -> NDArray[np.bool_]:
        """In which states (N,) the condition holds; ValueError if it is none, or uses other names."""
        expression = read_condition(text)
        self._check_truth(expression, text)
        return np.not_equal(self._values(expression, f"condition {shortened(text)!r}", 0.0)[0], 0.0)

    def values(self, text: str) -> tuple[Floats, float]:
        """The value (N,) of a formula in counts and labels, which are 1 or 0, in every state; its relative error.

        ValueError: it loses its digits in a state.
        """
        return self._values(read_condition(text), f"formula {shortened(text)!r}", LOST)

    def _values(self, expression: Expression, what: str, allowed: float) -> tuple[Floats, float]:
        if expression.reads_time:
            raise ValueError(f"{what}: depends on the time t; a state has none")
        used = expression.species
        unknown = [name for name in used if name not in self.variables and name not in self.labels]
        if unknown:
            raise ValueError(
                f"{what}: unknown name {unknown[0]!r}; the variables are {some_names(self.variables) or 'none'}, the "
                f"labels {some_names(self.labels) or 'none'}"
            )
        columns = [self.labels[name] if name in self.labels else self._column(name) for name in used]
        table = np.zeros((self.n_states, len(used)), dtype=np.int64)
        for place, column in enumerate(columns):
            table[:, place] = column
        places = {name: place for place, name in enumerate(used)}
        found = np.broadcast_to(evaluate(steps_of(expression, places), table, 0.0), (self.n_states,)).astype(np.float64)
        if not np.isfinite(found).all():
            raise ValueError(f"{what}: is no finite number in state {int(np.argmin(np.isfinite(found)))}")
        ends = enclosed(steps_of(expression, places, folds=False), table)
        low, high = (np.broadcast_to(end, (self.n_states,)) for end in ends)
        with np.errstate(all="ignore"):
            lost = np.where(
                low == high, 0.0, (high - low) / np.where(low * high > 0, np.fmin(abs(low), abs(high)), 0.0)
            )
        worst = int(np.argmax(np.where(np.isnan(lost), np.inf, lost)))
        if not lost[worst] <= allowed:
            raise ValueError(
                f"{what}: loses its digits in state {worst}, where it lies between {low[worst]:.3g} and "
                f"{high[worst]:.3g}; rewrite it so that large terms do not cancel"
            )
        return np.clip(found, low, high), 1.001 * float(lost.max(initial=0.0))

    def _column(self, name: str) -> Ints:
        return self.counts[:, self.variables[name]]

    def _check_truth(self, expression: Expression, text: str) -> None:
        """Every part that must be true or false is a comparison or a label."""
        formula = expression.formula
        waiting, seen = [len(formula) - 1], {len(formula) - 1}
        while waiting:
            place = waiting.pop()
            node = formula[place]
            if node.code in (Code.AND, Code.OR, Code.NOT):
                waiting += [part for part in reversed(node.parts) if part not in seen]
                seen.update(node.parts)
                continue
            is_number = node.code != Code.COUNT or (node.value not in self.labels and node.value in self.variables)
            if is_number and node.code not in TRUTHS:
                graph = Graph()
                shown = shortened(text_of(graph.formula(graph.copied(formula)[place])))
                raise ValueError(
                    f"condition {shortened(text)!r}: {shown} is a number, neither true nor false; compare it, as in "
                    f"{shown} >= 1"
                )


def names_in(text: str) -> tuple[str, ...]:
    """The variables and labels that a condition names; ValueError if it is none."""
    return tuple(read_condition(text).species)


def read_condition(text: str) -> Expression:
    """The formula of a condition; ValueError if it is none."""
    graph = Graph()
    return Expression.of(graph.formula(node_of(text, graph, dialect=PRISM)))


def _truth(graph: Graph, number: float) -> int:
    return graph.add(Code.EQUAL, (graph.number(1.0), graph.number(number)))


def state_names(model: Model, counts: Ints) -> StateNames:
    """What conditions may name in states (N, S); observables are named if they are whole sums."""
    sums = whole_sums(model, counts)
    columns = np.column_stack([counts, *sums.values()])
    variables = (*model.network.species, *sums)
    return StateNames(len(counts), variables, columns, BuiltInLabels(model, counts, variables))


@dataclass(frozen=True, eq=False)
class BuiltInLabels(Mapping[str, NDArray[np.bool_]]):
    """The labels of every chain in states (N, S), each computed when it is asked for; not those whose name is taken."""

    model: Model
    counts: Ints
    taken: Sequence[str]

    def __getitem__(self, name: str) -> NDArray[np.bool_]:
        if name not in self:
            raise KeyError(name)
        if name == INIT:
            return np.asarray((self.counts == self.model.initial).all(axis=1))
        network = self.model.network
        leads_on = network.stoichiometry.any(axis=1)
        blocks = np.array_split(self.counts, 1 + self.counts.shape[0] * len(network.channels) // BLOCK)
        return np.concatenate([~(network.propensities(block)[:, leads_on] > 0).any(axis=1) for block in blocks])

    def __contains__(self, name: object) -> bool:
        return name in (INIT, DEADLOCK) and name not in self.taken

    def __iter__(self) -> Iterator[str]:
        return (name for name in (INIT, DEADLOCK) if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)


def whole_sums(model: Model, counts: Ints) -> dict[str, Ints]:
    """Values (N,) in states (N, S) of the observables that are whole sums of counts, by name."""
    return {
        name: counts @ np.rint(weights).astype(np.int64)
        for name, weights in weights_of(model)
        if np.array_equal(weights, np.rint(weights))
    }


def weights_of(model: Model) -> list[tuple[str, Floats]]:
    """Weights (S,) of each observable by name; those named like a species are left out."""
    network = model.network
    sums = {name: sum_ for name, sum_ in model.observables.items() if name not in network.species_places}
    return [(name, summed(network, sum_)[0]) for name, sum_ in sums.items()]


@dataclass(frozen=True)
class Condition:
    """A condition on the counts of a model, as text that may also name its observables and the labels of every chain.

    text : comparisons of counts joined by & | ! => and brackets, as in "AB >= 8 & !(A == 0)"

    >>> import numpy as np
    >>> from kinetics import Model, Network
    >>> from kinetics.network.predicates import Condition
    >>> dimers = Model(Network.from_text("2 A <-> D, 1, 1"), {"A": 6}, {"bodies": {"A": 1, "D": 1}})
    >>> Condition("bodies <= 4", dimers).holds(np.array([[6, 0], [2, 2]])).tolist()
    [False, True]
    """

    text: str
    model: Model

    def holds(self, counts: Ints) -> NDArray[np.bool_]:
        """Mask (N,) of the counts (N, S) at which it holds. ValueError if the text is not a condition on this model."""
        return state_names(self.model, counts).holds(self.text)

    def weights(self) -> dict[str, dict[int, int]]:
        """Name -> its sum of counts, as whole weights by species number."""
        found = {name: {s: 1} for s, name in enumerate(self.model.network.species)}
        for name, weights in weights_of(self.model):
            if np.array_equal(weights, np.rint(weights)):
                found[name] = {int(s): int(weights[s]) for s in np.flatnonzero(weights)}
        return found

    def formula(self) -> tuple[Node, ...]:
        """The condition with conditions on counts in place of labels."""
        graph, network = Graph(), self.model.network
        read = read_condition(self.text)
        places = {}
        if INIT in read.species and INIT not in self.weights():
            start = zip(network.species, self.model.initial.tolist(), strict=True)
            alike = [graph.add(Code.EQUAL, (graph.name(name), graph.number(count))) for name, count in start]
            places[INIT] = graph.all_of(Code.AND, alike)
        if DEADLOCK in read.species and DEADLOCK not in self.weights():
            leads_on = np.flatnonzero(network.stoichiometry.any(axis=1)).tolist()
            stuck = [graph.add(Code.NOT, (_can_fire(network, r, graph),)) for r in leads_on]
            places[DEADLOCK] = graph.all_of(Code.AND, stuck or [_truth(graph, 1.0)])
        return graph.formula(graph.copied(read.formula, places)[-1])


def _can_fire(network: Network, channel: int, graph: Graph) -> int:
    """The node of whether a channel's propensity is above 0."""
    name = network.channels[channel]
    if name in network.laws:
        law = graph.copied(network.laws[name].with_numbers().formula)[-1]
        return graph.add(Code.LESS, (graph.number(0.0), law))
    if not network.known_rates[channel] * network.ways[channel]:
        return _truth(graph, 0.0)
    needed = zip(*(part.tolist() for part in network.sparse_reactants.row(channel)), strict=True)
    there = [graph.add(Code.LESS_EQUAL, (graph.number(n), graph.name(network.species[s]))) for s, n in needed]
    return graph.all_of(Code.AND, there or [_truth(graph, 1.0)])
