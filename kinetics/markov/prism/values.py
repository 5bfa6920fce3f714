"""Values of terms in many states at once, and bounds on their rounding errors.

Of `a & b` the second is asked for only where the first is true, as of other operators that need not know both, so that
`x > 0 & 1 / x < 2` has a value everywhere. What has none (a division by zero) is refused with its place and state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.prism.terms import BOOL, DOUBLE, Term
from kinetics.markov.prism.tokens import ModelTextError
from kinetics.network.laws.enclosure import Interval, enclosed_by
from kinetics.network.laws.graph import Code
from kinetics.support.arrays import Ints

Values = NDArray[Any]  # (n,), or () if they are the same in all states
FOLDED: dict[str, Callable[[Any, Any], Any]] = {
    "+": np.add,
    "*": np.multiply,
    "min": np.minimum,
    "max": np.maximum,
}
COMPARED: dict[str, Callable[[Any, Any], Any]] = {
    "=": np.equal,
    "<=>": np.equal,
    "!=": np.not_equal,
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
}
OF_ONE: dict[str, Callable[[Any], Any]] = {
    "negate": np.negative,
    "!": np.logical_not,
    "floor": np.floor,
    "ceil": np.ceil,
    "round": lambda number: np.floor(number + 0.5),
}
CODES = {
    "+": Code.ADD,
    "*": Code.MULTIPLY,
    "/": Code.DIVIDE,
    "min": Code.MINIMUM,
    "max": Code.MAXIMUM,
    "pow": Code.POWER,
    "negate": Code.NEGATE,
}


class States:
    """States in which terms are asked for their values.

    names : of the V variables
    kinds : int or bool, of each
    table : (n, V) values
    failed : truths of states: of those among `rows` in which a term has no value they become true. None to refuse them
    """

    def __init__(
        self,
        names: Sequence[str],
        kinds: Sequence[str],
        table: Ints,
        failed: NDArray[np.bool_] | None = None,
        rows: Ints | None = None,
    ) -> None:
        self.names, self.kinds, self.table = names, kinds, table
        self._failed, self._rows = failed, np.arange(len(table)) if rows is None else rows
        self._columns: dict[int, Values] = {}

    def __len__(self) -> int:
        return len(self.table)

    def column(self, place: int) -> Values:
        """Values (n,) of a variable: truths, or whole numbers as doubles."""
        if place not in self._columns:
            column = self.table[:, place]
            self._columns[place] = column.astype(bool if self.kinds[place] == BOOL else np.float64)
        return self._columns[place]

    def picked(self, chosen: Any) -> States:
        """Some of the states, by a mask (n,) or by their rows."""
        return States(self.names, self.kinds, self.table[chosen], self._failed, self._rows[chosen])

    def shown(self, row: int) -> str:
        """A state in a message."""
        values = zip(self.names, self.kinds, self.table[row].tolist(), strict=True)
        pairs = [f"{name}={str(bool(value)).lower() if kind == BOOL else value}" for name, kind, value in values]
        return ", ".join(pairs[:30]) + (", ..." if len(pairs) > 30 else "")

    def refuse(self, wrong: Any, term: Term, fault: str, shows: bool = False) -> None:
        """A ModelTextError if a mask, (n,) or (), holds in a state; or the note that these states have failed.

        shows : whether the message has a state even if the term is the same in all
        """
        if self._failed is not None:
            self._failed[self._rows[np.broadcast_to(wrong, (len(self),))]] = True
        elif np.any(wrong):
            is_everywhere = not self.names or (term.is_known and not shows)
            where = "" if is_everywhere else f" in the state {self.shown(int(np.argmax(wrong)))}"
            raise ModelTextError(f"{fault}{where}", term.token)


NOWHERE = States((), (), np.zeros((1, 0), dtype=np.int64))  # for terms without variables


def values_of(term: Term, states: States) -> Values:
    """Values (n,) or () of a term: truths, or doubles. ModelTextError: it has none in one of the states.

    >>> from kinetics.markov.prism.expressions import ExpressionReader
    >>> from kinetics.markov.prism.terms import Scope
    >>> from kinetics.markov.prism.tokens import TokenReader
    >>> from kinetics.markov.prism.values import States, values_of
    >>> import numpy as np
    >>> written = ExpressionReader(TokenReader("x > 0 ? 6 / x : -1")).expression()
    >>> scope = Scope({"x": (0, "int")}, lambda token, depth: None, {})
    >>> values_of(scope.term(written), States(["x"], ["int"], np.array([[0], [4]]))).tolist()
    [-1.0, 1.5]
    """
    operation, parts = term.operation, term.parts
    if operation == "constant":
        return np.asarray(term.value)
    if operation == "variable":
        return states.column(term.value)
    if operation in ("&", "|", "=>", "?"):
        return _decided(term, states)
    inner = [values_of(part, states) for part in parts]
    with np.errstate(all="ignore"):
        if operation in FOLDED:
            return np.asarray(reduce(FOLDED[operation], inner))
        if operation in COMPARED:
            return np.asarray(COMPARED[operation](*inner))
        if operation in OF_ONE:
            return np.asarray(OF_ONE[operation](*inner))
        return _fallible(term, states, *inner)


def _decided(term: Term, states: States) -> Values:
    """Operators that ask for a part only where they need it."""
    first, *others = term.parts
    found = values_of(first, states)
    match term.operation:
        case "&":
            for part in others:
                found = found & _only(part, states, found)
        case "|":
            for part in others:
                found = found | _only(part, states, ~found)
        case "=>":
            found = ~found | _only(others[0], states, found)
        case _:
            found = np.where(found, _only(others[0], states, found), _only(others[1], states, ~found))
    return np.asarray(found)


def _only(term: Term, states: States, needed: Values) -> Values:
    """Values where they are needed; others mean nothing."""
    if not term.can_fail or needed.all():
        return values_of(term, states)
    found = np.zeros(len(states), dtype=bool if term.kind == BOOL else np.float64)
    if needed.any():  # in some, so that the mask is one of states
        found[needed] = values_of(term, states.picked(needed))
    return found


def _fallible(term: Term, states: States, left: Values, right: Values) -> Values:
    """Functions that have no value for some arguments."""
    match term.operation:
        case "/":
            states.refuse(right == 0, term.parts[1]._replace(token=term.token), "division by zero")
            return np.asarray(left / right)
        case "mod":
            states.refuse(right <= 0, term, "the remainder of a division by zero or less")
            return np.asarray(np.mod(left, right))
        case "log":
            states.refuse((left <= 0) | (right <= 0) | (right == 1), term, "a logarithm that does not exist")
            return np.asarray(np.log(left) / np.log(right))
    found = np.asarray(np.power(left, right))
    states.refuse(~np.isfinite(found), term, "a power that does not exist, or is too large")
    if term.kind == DOUBLE:
        return found
    states.refuse(right < 0, term, "a whole number to a power below 0; write the base as a double")
    return np.asarray(np.rint(found))  # a library's power may miss a whole number by its last bit


def bounds_of(term: Term, states: States) -> Interval:
    """Bounds (n,) or () on the real value of a number, which has one in all of these states.

    Its decimal numbers are the doubles that they are read as. What it depends on in comparisons is decided as
    `values_of` decides it, by doubles.
    """
    if term.bounds is not None:
        return Interval(*term.bounds)
    if term.kind != DOUBLE or term.operation == "constant":
        exact = values_of(term, states).astype(np.float64)
        return Interval(exact, exact)
    if term.operation == "?":
        condition = values_of(term.parts[0], states)
        (low, high), (other_low, other_high) = (bounds_of(part, states) for part in term.parts[1:])
        return Interval(np.where(condition, low, other_low), np.where(condition, high, other_high))
    inner = [bounds_of(part, states) for part in term.parts]
    with np.errstate(all="ignore"):
        if term.operation == "log":
            top, bottom = (enclosed_by(Code.LOG, part) for part in inner)
            return enclosed_by(Code.DIVIDE, top, bottom)
        code = CODES[term.operation]
        if len(inner) == 1:
            return enclosed_by(code, inner[0])
        return reduce(lambda one, other: enclosed_by(code, one, other), inner)
