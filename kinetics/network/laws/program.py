"""Rate laws compiled for a stack machine: an operation code, an operand and a number for each step.

One machine in `kernels.general` runs them event by event and over stretches of time; `evaluate` runs them here, over
arrays of states.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import TRUTHS, Code, Node
from kinetics.support.arrays import Floats, Ints

MOST_HELD = 2**22  # numbers that `evaluate` has on its stack at a time; more states come in pieces
VISIT, APPLY, JUDGE = range(3)  # what is left to do with a node: its parts, its own step, whether it is other than 0


class Step(NamedTuple):
    """One step of a program."""

    code: Code
    operand: int = 0
    number: float = 0.0


UFUNCS = {
    Code.ADD: np.add,
    Code.SUBTRACT: np.subtract,
    Code.MULTIPLY: np.multiply,
    Code.DIVIDE: np.divide,
    Code.MODULO: np.mod,
    Code.POWER: np.power,
    Code.LESS: np.less,
    Code.LESS_EQUAL: np.less_equal,
    Code.EQUAL: np.equal,
    Code.NOT_EQUAL: np.not_equal,
    Code.AND: np.logical_and,
    Code.OR: np.logical_or,
    Code.MINIMUM: np.minimum,
    Code.MAXIMUM: np.maximum,
    Code.NEGATE: np.negative,
    Code.NOT: np.logical_not,
    Code.EXP: np.exp,
    Code.LOG: np.log,
    Code.SQRT: np.sqrt,
    Code.ABSOLUTE: np.abs,
    Code.SINE: np.sin,
    Code.COSINE: np.cos,
    Code.FLOOR: np.floor,
    Code.CEILING: np.ceil,
}


def steps_of(expression: Expression, places: Mapping[str, int], folds: bool = True) -> list[Step]:
    """The program of an expression; its steps are in proportion to the nodes.

    places : number of each species
    folds : whether constant nodes are folded into their rounded value
    """
    expression.check_names("expression", places)
    return _Compiling(expression, places, folds).steps()


def known_numbers(expression: Expression) -> list[float | None]:
    """The constant value of each node of an expression; None if it is not constant, or not finite."""
    found: list[float | None] = []
    learn_numbers(expression.formula, found, expression.parameters)
    return [number if number is not None and math.isfinite(number) else None for number in found]


def learn_numbers(
    nodes: Sequence[Node], known: list[float | None], parameters: Mapping[str, float] | None = None
) -> None:
    """Append the constant value of each new node; None if it depends on counts or the time."""
    with np.errstate(all="ignore"):
        for code, parts, value in nodes[len(known) :]:
            found: float | None = None
            if code == Code.CONSTANT:
                found = float(value)
            elif code == Code.COUNT and parameters:
                found = parameters.get(str(value))
            elif parts:
                inner = [known[part] for part in parts]
                numbers = [] if None in inner else [np.full((), number) for number in inner]
                found = float(_applied(code, numbers)) if numbers else None
            known.append(found)


def _applied(code: Code, numbers: Sequence[Floats]) -> Floats:
    if code == Code.SELECT:
        value, condition, other = numbers
        return np.where(condition != 0, value, other)
    return np.asarray(UFUNCS[code](*numbers), dtype=np.float64)


class _Compiling:
    """One expression while its program is made: depth first, without recursion; what occurs twice is kept."""

    def __init__(self, expression: Expression, places: Mapping[str, int], folds: bool):
        self.formula, self.places = expression.formula, places
        known = known_numbers(expression)
        self.known = [
            number if folds or node.code in (Code.CONSTANT, Code.COUNT) else None
            for number, node in zip(known, self.formula, strict=True)
        ]

    def steps(self) -> list[Step]:
        root = len(self.formula) - 1
        uses = self._uses(root)
        made: list[Step] = []
        kept: dict[int, int] = {}
        waiting = [(VISIT, root)]
        while waiting:
            task, place = waiting.pop()
            if task == JUDGE:
                made += [Step(Code.CONSTANT), Step(Code.NOT_EQUAL)]
            elif task == APPLY:
                made.append(self._step(place))
                if uses[place] > 1:
                    kept[place] = len(kept)
                    made.append(Step(Code.KEEP, kept[place]))
            elif place in kept:
                made.append(Step(Code.RECALL, kept[place]))
            elif self._is_leaf(place):
                made.append(self._step(place))
            else:
                waiting.append((APPLY, place))
                for position, part in reversed(list(enumerate(self._parts(place)))):
                    if self._is_truth(place, position) and self.formula[part].code not in TRUTHS:
                        waiting.append((JUDGE, part))
                    waiting.append((VISIT, part))
        return made

    def _is_leaf(self, place: int) -> bool:
        return self.known[place] is not None or not self.formula[place].parts

    def _parts(self, place: int) -> tuple[int, ...]:
        """The parts whose steps come before that of a node."""
        parts = self.formula[place].parts
        return parts if self._times(place) is None else parts[:1]

    def _is_truth(self, place: int, position: int) -> bool:
        code = self.formula[place].code
        return code in (Code.AND, Code.OR, Code.NOT) or (code == Code.SELECT and position == 1)

    def _step(self, place: int) -> Step:
        """The last step of a node."""
        node, number = self.formula[place], self.known[place]
        if number is not None:
            return Step(Code.CONSTANT, 0, number)
        if node.code == Code.COUNT:
            return Step(Code.COUNT, self.places[str(node.value)])
        return self._times(place) or Step(node.code)

    def _times(self, place: int) -> Step | None:
        """A product with a count, or with a count less a number, in one step."""
        if self.formula[place].code != Code.MULTIPLY:
            return None
        right = self.formula[place].parts[1]
        less: float | None = 0.0
        if self.formula[right].code == Code.SUBTRACT:
            right, other = self.formula[right].parts
            less = self.known[other]
        if less is None or self.known[right] is not None or self.formula[right].code != Code.COUNT:
            return None
        return Step(Code.TIMES, self.places[str(self.formula[right].value)], less)

    def _uses(self, root: int) -> list[int]:
        """How often each node is needed."""
        uses = [0] * len(self.formula)
        uses[root] = 1
        for place in range(root, -1, -1):  # wholes before parts
            if uses[place] and not self._is_leaf(place):
                for part in self._parts(place):
                    uses[part] += 1
        return uses


def evaluate(steps: Sequence[Step], states: Ints | Floats, time: float) -> Floats:
    """Values (...) of a program at states (..., S) and a time. What is undefined is nan or inf."""
    shape = states.shape[:-1]
    piece = max(1, MOST_HELD // max(1, depth(steps)))
    if math.prod(shape) > piece:
        flat = states.reshape(math.prod(shape), states.shape[-1])
        values = [_evaluated(steps, flat[begin : begin + piece], time) for begin in range(0, len(flat), piece)]
        return np.concatenate(values).reshape(shape)
    return _evaluated(steps, states, time)


def _evaluated(steps: Sequence[Step], states: Ints | Floats, time: float) -> Floats:
    shape = states.shape[:-1]
    stack: list[Floats] = []
    kept: dict[int, Floats] = {}
    ends = np.zeros(shape, dtype=bool)  # where a guard found too few copies
    with np.errstate(all="ignore"):
        for code, operand, number in steps:
            if code == Code.CONSTANT:
                stack.append(np.full(shape, number))
            elif code == Code.CLOCK:
                stack.append(np.full(shape, time))
            elif code == Code.COUNT:
                stack.append(states[..., operand].astype(np.float64))
            elif code == Code.TIMES:
                stack[-1] = stack[-1] * (states[..., operand].astype(np.float64) - number)
            elif code == Code.GUARD:
                ends |= states[..., operand] < number
            elif code == Code.REFUSE:
                stack[-1] = np.where((states[..., operand] < number) & (stack[-1] > 0), np.nan, stack[-1])
            elif code == Code.SELECT:
                other, condition, value = stack.pop(), stack.pop(), stack.pop()
                stack.append(np.where(condition != 0, value, other))
            elif code == Code.KEEP:
                kept[operand] = stack[-1]
            elif code == Code.RECALL:
                stack.append(kept[operand])
            elif code >= Code.NEGATE:
                stack.append(UFUNCS[code](stack.pop()).astype(np.float64))
            else:
                right, left = stack.pop(), stack.pop()
                stack.append(UFUNCS[code](left, right).astype(np.float64))
    return np.where(ends, 0.0, stack[-1])


def depth(steps: Iterable[Step]) -> int:
    """Largest count of numbers that a program holds, on the stack and in registers."""
    height = deepest = kept = 0
    for code, _, _ in steps:
        if code in (Code.CONSTANT, Code.COUNT, Code.CLOCK, Code.RECALL):
            height += 1
        elif code == Code.SELECT:
            height -= 2
        elif code == Code.KEEP:
            kept += 1
        elif Code.ADD <= code <= Code.MAXIMUM:
            height -= 1
        deepest = max(deepest, height)
    return deepest + kept
