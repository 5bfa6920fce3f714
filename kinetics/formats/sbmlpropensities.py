"""The formulas of a network as SBML has them: propensities, laws and numbers of events, in plain parameters."""

from __future__ import annotations

from math import factorial

from kinetics.formats.directions import bounds_of, is_0_without
from kinetics.network import Network
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code, Graph, Node

MOST_COPIES = 170  # of one species: the factorial of more is beyond all floats
MOST_TRIED = 4  # copies of a reactant up to which a law is looked at for being 0 with fewer


class Formulas:
    """The formulas of a network in counts, and in those of its parameters that are plain numbers.

    parameters : these, as far as a rate constant, a law or an event depends on them
    """

    def __init__(self, network: Network) -> None:
        self.network, self.given = network, network.given.given
        used = [*network.laws.values(), *network.given.rates.values()]
        for event in network.events:
            used += [event.condition, event.waits, *event.new_counts.values()]
        found = {name for each in used for name in self.plain(each).parameters}
        self.parameters = [name for name in self.given if name in found]

    def plain(self, formula: Expression) -> Expression:
        """A formula, with numbers and formulas in place of all other parameters."""
        graph = Graph()
        return self._of(graph, self._copied(graph, formula))

    def propensity(self, r: int) -> Expression:
        """Rate constant times ways times combinations or law, which is 0 where reactants are missing.

        ValueError: the combinations of so many copies are beyond all floats
        """
        network, graph = self.network, Graph()
        name, (places, copies) = network.channels[r], network.sparse_reactants.row(r)
        needed = {network.species[s]: n for s, n in zip(places.tolist(), copies.tolist(), strict=True)}
        law, constant = network.laws.get(name), network.given.rates.get(name)
        number = float(network.ways[r]) * (1.0 if constant is not None else float(network.known_rates[r]))
        factors = [] if constant is None else [self._copied(graph, constant)]
        if law is not None:
            factors.append(self._copied(graph, law))
            written = self._of(graph, factors[-1])
            waits = [each for each, n in needed.items() if not _is_0_below(written, each, n)]
        else:
            waits = [each for each, n in needed.items() if n > 1 and network.combinations == "product"]
            factors += [place for each, n in needed.items() for place in self._combinations(graph, name, each, n)]
        if number != 1.0 or not factors:
            factors.insert(0, graph.number(number))
        whole = graph.all_of(Code.MULTIPLY, factors)
        if waits:
            enough = [
                graph.add(Code.LESS_EQUAL, (graph.number(float(needed[each])), graph.name(each))) for each in waits
            ]
            whole = graph.add(Code.SELECT, (whole, graph.all_of(Code.AND, enough), graph.number(0.0)))
        return self._of(graph, whole)

    def _combinations(self, graph: Graph, channel: str, species: str, copies: int) -> list[int]:
        """Factors of the ways to choose so many copies, as the network counts them."""
        count = graph.name(species)
        if copies == 1:
            return [count]
        if self.network.combinations == "product":
            return [graph.add(Code.POWER, (count, graph.number(float(copies))))]
        if copies > MOST_COPIES:
            raise ValueError(
                f"channel {channel!r} needs {copies} copies of one species, too many for a formula of SBML; "
                f"write the reaction in steps of fewer reactants"
            )
        factors = [count, *(graph.add(Code.SUBTRACT, (count, graph.number(float(i)))) for i in range(1, copies))]
        if self.network.combinations == "distinct":
            factors[-1] = graph.add(Code.DIVIDE, (factors[-1], graph.number(float(factorial(copies)))))
        return factors

    def _copied(self, graph: Graph, formula: Expression) -> int:
        """The place of a formula in a graph, with what parameters are formulas of."""
        places: dict[str, int] = {}
        for name, each in self.given.items():
            if isinstance(each, Expression):
                places[name] = graph.copied(each.formula, places)[-1]
        numbers = {name: graph.number(value) for name, value in formula.parameters.items() if name not in self.given}
        return graph.copied(formula.formula, {**places, **numbers})[-1]

    def _of(self, graph: Graph, place: int) -> Expression:
        nodes = graph.formula(place)
        names = {str(node.value) for node in nodes if node.code == Code.COUNT}
        values = self.network.parameters
        return Expression.of(nodes, {name: values[name] for name in self.given if name in names})


def _is_0_below(law: Expression, species: str, copies: int) -> bool:
    """Whether a law is proven to be 0 with fewer copies of a species, for all parameters at which it is defined."""
    if copies > MOST_TRIED:
        return False
    for n in range(copies):
        there = Node(Code.CONSTANT, (), float(n))
        fewer = tuple(there if node[::2] == (Code.COUNT, species) else node for node in law.formula)
        if bounds_of(Expression.of(fewer), {})[-1] != (0.0, 0.0):
            return False
        if not is_0_without(Expression.of(fewer, law.parameters), (species,)):
            return False
    return True
