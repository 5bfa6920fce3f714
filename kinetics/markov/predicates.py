"""Conditions on the states of a chain as text, such as `quadmer >= 1 and monomer == 0` or `"done" | !(A > 3)`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from kinetics.network.checks import some_names
from kinetics.network.laws.enclosure import enclosed
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import TRUTHS, Code, Graph
from kinetics.network.laws.program import evaluate, steps_of
from kinetics.network.laws.reading import OURS, Dialect, node_of, shortened
from kinetics.network.laws.writing import text_of
from kinetics.support.arrays import Floats, Ints

PRISM = Dialect(
    spellings={"&": "and", "|": "or", "!": "not", "=": "=="},
    constants={**OURS.constants, "true": lambda graph: _truth(graph, 1.0), "false": lambda graph: _truth(graph, 0.0)},
)


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
        """In which states (N,) the condition holds; a ValueError where it is none, or uses other names."""
        expression = _read(text)
        self._check_truth(expression, text)
        return self._values(expression, f"condition {shortened(text)!r}", 0.0)[0] != 0.0

    def values(self, text: str) -> tuple[Floats, float]:
        """The value (N,) of a formula in counts and labels, which are 1 or 0, in every state; its relative error.

        ValueError: it loses its digits in a state.
        """
        return self._values(_read(text), f"formula {shortened(text)!r}", LOST)

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
                f"{what}: loses its digits in state {worst}, where it is from {low[worst]:.3g} to {high[worst]:.3g}; "
                "write it so that large terms do not cancel"
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
    """The variables and labels that a condition names; a ValueError where it is none."""
    return tuple(_read(text).species)


def _read(text: str) -> Expression:
    graph = Graph()
    return Expression.of(graph.formula(node_of(text, graph, dialect=PRISM)))


def _truth(graph: Graph, number: float) -> int:
    return graph.add(Code.EQUAL, (graph.number(1.0), graph.number(number)))
