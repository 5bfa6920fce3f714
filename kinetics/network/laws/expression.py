"""Expressions in species counts, parameters and time, such as "vmax * S / (K + S)".

They are parsed by Python's own grammar, of which only arithmetic is let through; nothing is ever executed as Python.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

TIME, PI = "t", "pi"
RESERVED = (TIME, PI)
# Smallest and largest number of arguments; piecewise takes an odd number: value, condition, ..., value otherwise.
FUNCTIONS = {
    "exp": (1, 1),
    "log": (1, 1),
    "sqrt": (1, 1),
    "abs": (1, 1),
    "sin": (1, 1),
    "cos": (1, 1),
    "floor": (1, 1),
    "ceil": (1, 1),
    "pow": (2, 2),
    "min": (2, 100),
    "max": (2, 100),
    "piecewise": (3, 201),
}
OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Mod, ast.Pow, ast.UAdd, ast.USub, ast.Not)
COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
LONGEST = 10_000  # characters


@dataclass(frozen=True)
class Expression:
    """A formula in counts, parameters and time, such as a rate law.

    text : + - * / % **, comparisons (1 or 0), and, or, not, `FUNCTIONS`, pi, and t for the time in tu. Any other name
        is a parameter or a species; one that is no plain name, or that is t or pi, is quoted: "k * 'A-B'"
    parameters : name -> value

    Logarithms are natural, angles in radian, % is the remainder with the sign of the divisor.
    """

    text: str
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.text, str) or not self.text.strip():
            raise ValueError(f"{self.text!r} is no expression; expected text such as 'k * A * B'")
        object.__setattr__(self, "text", " ".join(self.text.split()))
        parameters = {}
        for name, value in self.parameters.items():
            is_number = isinstance(value, int | float) or hasattr(value, "__float__")
            if isinstance(value, bool | str) or not is_number or not math.isfinite(value):
                raise ValueError(f"parameter {name!r} = {value!r}; expected a finite number")
            if name in RESERVED:
                raise ValueError(f"a parameter cannot be called {name!r}: that is {_meaning(name)}")
            parameters[name] = float(value)
        object.__setattr__(self, "parameters", parameters)
        self._check()

    def __str__(self) -> str:
        used = {name: self.parameters[name] for name in self._names if name in self.parameters}
        values = ", ".join(f"{name} = {value:g}" for name, value in used.items())
        return f"{self.text}  ({values})" if values else self.text

    @cached_property
    def tree(self) -> ast.expr:
        """The syntax tree of the text, as in Python's `ast`."""
        if len(self.text) > LONGEST:
            raise ValueError(f"an expression of {len(self.text)} characters; at most {LONGEST} are read")
        try:
            return ast.parse(self.text, mode="eval").body
        except SyntaxError as error:
            raise ValueError(f"cannot read {self.text!r}: {error.msg} at column {error.offset or 1}") from None
        except (RecursionError, MemoryError, ValueError) as error:
            raise ValueError(f"cannot read {self.text[:80]!r}: {error or 'nested too deeply'}") from None

    @cached_property
    def _names(self) -> dict[str, ast.expr]:
        """Every name that is no function, t or pi -> where it is first used."""
        found: dict[str, ast.expr] = {}
        for node in _walk(self.tree):
            name = name_of(node)
            if name is not None:
                found.setdefault(name, node)
        return found

    @property
    def species(self) -> tuple[str, ...]:
        """The names that are not parameters, in the order of their first use."""
        return tuple(name for name in self._names if name not in self.parameters)

    @property
    def reads_time(self) -> bool:
        """Whether it depends on the time."""
        return any(isinstance(node, ast.Name) and node.id == TIME for node in _walk(self.tree))

    @property
    def is_condition(self) -> bool:
        """Whether it is true or false, not a number."""
        return is_condition(self.tree)

    def check_names(self, what: str, species: Mapping[str, int]) -> None:
        """A ValueError where a name is neither a parameter nor one of these species, or both."""
        for name, node in self._names.items():
            if name not in species and name not in self.parameters:
                known = ", ".join(self.parameters) or "none"
                raise ValueError(
                    f"{what}: unknown name {name!r} {self._place(node)}; the species are {some_names(species)}, "
                    f"the parameters {known}"
                )
            if name in species and name in self.parameters:
                raise ValueError(f"{what}: {name!r} {self._place(node)} is both a species and a parameter; rename one")

    def _place(self, node: ast.expr) -> str:
        return f"at column {node.col_offset + 1} of {self.text!r}"

    def _check(self) -> None:
        for node in _walk(self.tree):
            fault = _fault(node)
            if fault:
                raise ValueError(f"{fault} {self._place(node)}")


def _walk(node: ast.expr) -> Iterator[ast.expr]:
    """A node and all below it that stand for values, without recursion."""
    waiting = [node]
    while waiting:
        node = waiting.pop()
        yield node
        inner = node.args if isinstance(node, ast.Call) else list(ast.iter_child_nodes(node))
        waiting.extend(reversed([child for child in inner if isinstance(child, ast.expr)]))


def name_of(node: ast.expr) -> str | None:
    """The species or parameter that a node stands for."""
    if isinstance(node, ast.Name):
        return None if node.id in RESERVED else node.id
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def is_condition(node: ast.expr) -> bool:
    """Whether a node is true or false, not a number."""
    is_negation = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    return is_negation or isinstance(node, ast.Compare | ast.BoolOp)


def _fault(node: ast.expr) -> str | None:
    """What is wrong with a node, apart from those below it."""
    if isinstance(node, ast.Constant):
        return _fault_of_constant(node.value)
    if isinstance(node, ast.Name):
        return f"{node.id!r} is a function; expected arguments after it" if node.id in FUNCTIONS else None
    if isinstance(node, ast.Call):
        return _fault_of_call(node)
    if isinstance(node, ast.BinOp | ast.UnaryOp):
        if isinstance(node.op, ast.BitXor):
            return "^ is no power here; write **"
        return None if isinstance(node.op, OPERATORS) else f"{type(node.op).__name__} is not allowed"
    if isinstance(node, ast.Compare):
        return None if all(isinstance(op, COMPARISONS) for op in node.ops) else "only < <= > >= == != compare"
    if isinstance(node, ast.BoolOp):
        return None
    return f"{type(node).__name__} is not allowed; only arithmetic, comparisons, and, or, not and functions are"


def _fault_of_constant(value: object) -> str | None:
    if isinstance(value, str):
        return None if value else "an empty name"
    if isinstance(value, bool | complex | bytes) or not isinstance(value, int | float):
        return f"{value!r} is no number"
    try:
        return None if math.isfinite(float(value)) else "a number beyond 1e308"
    except OverflowError:
        return "a number beyond 1e308"


def _fault_of_call(node: ast.Call) -> str | None:
    name = node.func.id if isinstance(node.func, ast.Name) else ast.unparse(node.func)
    if name not in FUNCTIONS:
        return f"unknown function {name!r}; there are {', '.join(FUNCTIONS)}"
    least, most = FUNCTIONS[name]
    n = len(node.args)
    if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
        return f"{name} takes plain arguments only"
    if name == "piecewise" and (n < least or n % 2 == 0):
        return f"piecewise has {n} arguments; expected value, condition, ..., and a value otherwise"
    if not least <= n <= most:
        expected = str(least) if least == most else f"{least} to {most}"
        return f"{name} has {n} arguments; expected {expected}"
    return None


def quoted(name: str) -> str:
    """A species' name as an expression writes it."""
    is_plain = name.isidentifier() and name not in (*RESERVED, *FUNCTIONS, "and", "or", "not", "True", "False", "None")
    return name if is_plain and not _is_keyword(name) else repr(name)


def _is_keyword(name: str) -> bool:
    import keyword

    return keyword.iskeyword(name)


def _meaning(name: str) -> str:
    return "the time" if name == TIME else "3.14159..."


def some_names(names: Collection[str]) -> str:
    """The first dozen of the names, and how many more there are."""
    shown = list(names)[:12]
    return ", ".join(shown) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
