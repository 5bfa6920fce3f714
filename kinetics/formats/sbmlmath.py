"""SBML formulas as nodes of a graph, by a walk over libsbml's tree; functions are expanded in the graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from kinetics.formats.sbmloperators import builders
from kinetics.network.laws.graph import Graph, Node
from kinetics.support.packages import libsbml

SHOWN = 80  # characters of a formula in a message


class Functions:
    """The functions that a model defines, each made a formula of its arguments once."""

    def __init__(self, defined: Mapping[str, Any], graph: Graph):
        self.defined, self.graph = defined, graph
        self.bodies: dict[str, tuple[list[str], tuple[Node, ...]]] = {}
        self.calls: dict[tuple[str, tuple[int, ...]], int] = {}

    def call(self, name: str, arguments: Sequence[int]) -> int:
        """The node of a call; a ValueError for a function that is not defined, or not so."""
        key = name, tuple(arguments)
        if key not in self.calls:
            self._prepare(name)
            self.calls[key] = self._expanded(self.graph, name, arguments)
        return self.calls[key]

    def _expanded(self, graph: Graph, name: str, arguments: Sequence[int]) -> int:
        names, body = self.bodies[name]
        if len(arguments) != len(names):
            raise ValueError(f"the function {name!r} takes {len(names)} arguments; {len(arguments)} came")
        return graph.copied(body, dict(zip(names, arguments, strict=True)))[-1]

    def _prepare(self, name: str) -> None:
        """The formulas of a function and of those that it calls, these first."""
        opened: dict[str, None] = {}
        waiting = [name]
        while waiting:
            name = waiting[-1]
            needed = [] if name in self.bodies or name in opened else self._called_by(name)
            for each in needed:
                if each in opened or each == name:
                    raise ValueError(f"functions call each other in a circle: {', '.join([*opened, name])}")
            if needed:
                opened[name] = None
                waiting += needed
                continue
            if name not in self.bodies:
                self.bodies[name] = self._body(name)
            opened.pop(name, None)
            waiting.pop()

    def _called_by(self, name: str) -> list[str]:
        definition = self.defined.get(name)
        if definition is None or definition.getBody() is None:
            raise ValueError(f"the function {name!r} has no formula")
        _, called = names_in(definition.getBody())
        return [each for each in called if each not in self.bodies]

    def _body(self, name: str) -> tuple[list[str], tuple[Node, ...]]:
        definition = self.defined[name]
        names = [definition.getArgument(i).getName() for i in range(definition.getNumArguments())]
        graph = Graph(self.graph.most)

        def argument(asked: str) -> int:
            if asked not in names:
                raise ValueError(f"the function {name!r} uses {asked!r}, which is no argument of it")
            return graph.name(asked)

        known: dict[tuple[str, tuple[int, ...]], int] = {}

        def call(asked: str, arguments: Sequence[int]) -> int:
            key = asked, tuple(arguments)
            if key not in known:
                known[key] = self._expanded(graph, asked, arguments)
            return known[key]

        whole = node_of(definition.getBody(), graph, argument, call, graph.time())
        return names, graph.formula(whole)


def node_of(
    root: Any,
    graph: Graph,
    meaning: Callable[[str], int],
    call: Callable[[str, Sequence[int]], int],
    time: int,
) -> int:
    """The node of a formula, over libsbml's tree without recursion: a sum of thousands of terms is thousands deep.

    meaning : the node that an id stands for; it raises a ValueError for an unknown one
    call : the node of a call of a defined function
    A ValueError for what has no counterpart here.
    """
    made: list[int] = []  # of the parts that no whole has taken in yet
    for part in reversed(parts_of(root)):
        n = part.getNumChildren()
        inner = made[len(made) - n :]
        del made[len(made) - n :]
        made.append(_node_of_part(part, inner, graph, meaning, call, time))
    return made[0]


def names_in(root: Any) -> tuple[dict[str, None], dict[str, None]]:
    """The ids that a formula reads, and the functions that it calls, in order."""
    ids: dict[str, None] = {}
    called: dict[str, None] = {}
    for part in parts_of(root):
        kind = part.getType()
        if kind == libsbml.AST_NAME:
            ids[part.getName()] = None
        elif kind == libsbml.AST_FUNCTION:
            called[part.getName()] = None
    return ids, called


def parts_of(root: Any) -> list[Any]:
    """A formula and its parts, wholes before parts."""
    parts, waiting = [], [root]
    while waiting:
        part = waiting.pop()
        parts.append(part)
        waiting += [part.getChild(i) for i in range(part.getNumChildren())]
    return parts


def _node_of_part(
    part: Any,
    inner: list[int],
    graph: Graph,
    meaning: Callable[[str], int],
    call: Callable[[str, Sequence[int]], int],
    time: int,
) -> int:
    """The node of a formula whose parts are `inner`."""
    kind = part.getType()
    if kind == libsbml.AST_INTEGER:
        return graph.number(part.getInteger())
    if kind in (libsbml.AST_REAL, libsbml.AST_REAL_E, libsbml.AST_RATIONAL):
        return graph.number(part.getReal())
    if kind == libsbml.AST_NAME:
        return meaning(part.getName())
    if kind == libsbml.AST_FUNCTION:
        return call(part.getName(), inner)
    if kind == libsbml.AST_NAME_TIME:
        return time
    build = builders().get(kind)
    found = build(graph, inner) if build else None
    if found is None:
        spelled = libsbml.formulaToL3String(part) or part.getName() or "a formula"
        raise ValueError(f"{spelled[:SHOWN]!r} cannot be written as a rate law here")
    return found
