"""Formulas as a graph: each node an operation on earlier nodes, a number, a name or the time.

What occurs twice is one node, so what a name stands for is shared and never copied: work grows with the nodes, however
often a formula comes back to them. Nodes are counted against a budget.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from enum import IntEnum
from typing import NamedTuple

MOST_NODES = 100_000  # of a formula, and of a file beyond what its own length allows


class Code(IntEnum):
    """Operations of formulas, and of the programs made of them; `kernels.programs` has the same numbers.

    TIMES, GUARD, REFUSE, KEEP and RECALL are of programs alone. In a formula, COUNT is a species or a parameter.
    """

    CONSTANT = 0  # push the number
    COUNT = 1  # push the count of species number `operand`
    CLOCK = 2  # push the time
    TIMES = 3  # multiply by that count less the number: the factor of mass action
    GUARD = 4  # end with 0 if there are fewer copies than the number
    REFUSE = 5  # what is above 0 becomes nan if there are fewer copies than the number
    ADD = 6
    SUBTRACT = 7
    MULTIPLY = 8
    DIVIDE = 9
    MODULO = 10
    POWER = 11
    LESS = 12
    LESS_EQUAL = 13
    EQUAL = 14
    NOT_EQUAL = 15
    AND = 16
    OR = 17
    MINIMUM = 18
    MAXIMUM = 19
    NEGATE = 20
    NOT = 21
    EXP = 22
    LOG = 23
    SQRT = 24
    ABSOLUTE = 25
    SINE = 26
    COSINE = 27
    FLOOR = 28
    CEILING = 29
    SELECT = 30  # of value, condition and other value
    KEEP = 31  # remember the last number of the stack as number `operand`
    RECALL = 32  # push it


TRUTHS = frozenset({*range(Code.LESS, Code.MINIMUM), Code.NOT})  # these are true or false, not numbers
TOGETHER = (Code.ADD, Code.MULTIPLY, Code.AND, Code.OR, Code.MINIMUM, Code.MAXIMUM)  # of any number of parts


class BudgetError(ValueError):
    """Formulas that grow beyond their budget."""


class Node(NamedTuple):
    """One node.

    parts : places of the nodes that it is an operation on
    value : a constant's number, or a name
    """

    code: Code
    parts: tuple[int, ...] = ()
    value: float | str = 0.0


class Graph:
    """Nodes of any number of formulas, parts before wholes, each of them once.

    most : budget of nodes, those that are handed out or copied counted again; beyond it, a BudgetError
    """

    def __init__(self, most: int = MOST_NODES):
        self.nodes: list[Node] = []
        self.most = most
        self.handed_out = 0
        self._places: dict[object, int] = {}

    def add(self, code: Code, parts: Iterable[int] = (), value: float | str = 0.0) -> int:
        """The place of a node; an equal node is reused."""
        node = Node(code, tuple(parts), value)
        # a zero has a sign, which == does not see
        key = (node, math.copysign(1.0, value)) if code == Code.CONSTANT and value == 0.0 else node
        place = self._places.get(key)
        if place is None:
            self._spend(1)
            place = self._places[key] = len(self.nodes)
            self.nodes.append(node)
        return place

    def number(self, value: float) -> int:
        """A number; a ValueError for one that is not finite."""
        if not math.isfinite(value):
            raise ValueError(f"{value} in a formula; expected a finite number")
        return self.add(Code.CONSTANT, (), float(value))

    def name(self, name: str) -> int:
        """A species or a parameter."""
        return self.add(Code.COUNT, (), name)

    def time(self) -> int:
        """The time."""
        return self.add(Code.CLOCK)

    def all_of(self, code: Code, parts: Sequence[int]) -> int:
        """An operation of `TOGETHER` on at least one part, from left to right."""
        whole = parts[0]
        for part in parts[1:]:
            whole = self.add(code, (whole, part))
        return whole

    def is_known(self, place: int, value: float) -> bool:
        """Whether a node is literally this number."""
        return self.nodes[place].code == Code.CONSTANT and self.nodes[place].value == value

    def formula(self, place: int) -> tuple[Node, ...]:
        """A node and all below it as a formula of its own: parts before the whole, in the order of a text."""
        found = in_order(self.nodes, place) if self.nodes[place].parts else [place]
        self._spend(len(found))
        self.handed_out += len(found)
        moved = {old: new for new, old in enumerate(found)}
        return tuple(
            Node(code, tuple([moved[part] for part in parts]), value) if parts else self.nodes[old]
            for old, (code, parts, value) in ((old, self.nodes[old]) for old in found)
        )

    def copied(self, formula: Sequence[Node], places: dict[str, int] | None = None) -> list[int]:
        """Places of the nodes of a formula; its names become the nodes that they stand for, where these are given."""
        self._spend(len(formula))
        self.handed_out += len(formula)
        found: list[int] = []
        for code, parts, value in formula:
            known = places.get(value) if places and code == Code.COUNT else None  # type: ignore[arg-type]
            found.append(self.add(code, [found[part] for part in parts], value) if known is None else known)
        return found

    def _spend(self, nodes: int) -> None:
        if len(self.nodes) + self.handed_out + nodes > self.most:
            raise BudgetError(f"the formulas grow to over {self.most} operations; write them with fewer")


def in_order(nodes: Sequence[Node], place: int) -> list[int]:
    """Places of a node and all below it, parts before wholes, from left to right."""
    found: dict[int, None] = {}
    waiting = [place]
    while waiting:
        place = waiting[-1]
        left = [part for part in reversed(nodes[place].parts) if part not in found] if place not in found else []
        if left:
            waiting += left
        else:
            found[waiting.pop()] = None
    return list(found)
