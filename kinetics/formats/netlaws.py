"""Rate laws of .net files as nodes: functions of groups and parameters, and the named rate laws."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

from kinetics.network.laws.graph import Code, Graph
from kinetics.network.laws.reading import written


def law_of(
    graph: Graph, name: str, functions: Mapping[str, int], values: Sequence[int], reactants: Sequence[int]
) -> int:
    """The propensity of a reaction per way: the law times the ordered combinations of its reactants.

    name : of a function without arguments, or one of `KINDS` with the nodes of its `values`
    reactants : their nodes, in the order of the file
    """
    if name in functions:
        if values:
            raise ValueError(f"{name!r} is a function without arguments; {len(values)} came")
        return graph.all_of(Code.MULTIPLY, [functions[name], *_combinations(graph, reactants)])
    count, is_open, least, law = KINDS[name]
    most = max(count, len(reactants) + 1) if is_open else count
    if not count <= len(values) <= most or len(reactants) < least:
        wanted = f"{count} to {most}" if most > count else f"{count}"
        raise ValueError(
            f"{name} takes {wanted} numbers and at least {least} reactants; {len(values)} and {len(reactants)} came"
        )
    return law(graph, values, reactants)


def _combinations(graph: Graph, reactants: Sequence[int]) -> list[int]:
    """Factors n, n - 1, ... for each species."""
    return [
        graph.add(Code.SUBTRACT, (species, graph.number(i))) if i else species
        for species, copies in Counter(reactants).items()
        for i in range(copies)
    ]


def _saturation(graph: Graph, values: Sequence[int], reactants: Sequence[int]) -> int:
    """k / (K1 + A) / (K2 + B) ... times the combinations: a constant for each of the first reactants."""
    share, *halves = values
    if len(halves) > 1 and len(set(reactants)) < len(reactants):
        raise ValueError("Sat with several constants takes reactants that differ")
    for half, reactant in zip(halves, reactants, strict=False):
        share = graph.add(Code.DIVIDE, (share, graph.add(Code.ADD, (half, reactant))))
    return graph.all_of(Code.MULTIPLY, [share, *_combinations(graph, reactants)])


def _hill(graph: Graph, values: Sequence[int], reactants: Sequence[int]) -> int:
    """As `Sat` with powers, but the first reactant is in the law and not multiplied in again."""
    top, half, power = values
    share = written("k * A**n / (K**n + A**n)", graph, k=top, K=half, n=power, A=reactants[0])
    return graph.all_of(Code.MULTIPLY, [share, *_combinations(graph, reactants[1:])])


def _quasi_steady(graph: Graph, values: Sequence[int], reactants: Sequence[int]) -> int:
    """The total quasi-steady-state approximation of an enzyme: substrate first, then enzyme."""
    (k, half), (s, e) = values, reactants[:2]
    rest = written("S - K - E", graph, S=s, K=half, E=e)
    free = written("(rest + sqrt(rest**2 + 4 * K * S)) / 2", graph, rest=rest, K=half, S=s)
    return written("k * E * free / (K + free)", graph, k=k, E=e, K=half, free=free)


# Name -> how many numbers it takes, whether one more for each further reactant, how many reactants at least, its node.
KINDS: dict[str, tuple[int, bool, int, Callable[[Graph, Sequence[int], Sequence[int]], int]]] = {
    "Sat": (2, True, 1, _saturation),
    "Hill": (3, False, 1, _hill),
    "MM": (2, False, 2, _quasi_steady),
}
