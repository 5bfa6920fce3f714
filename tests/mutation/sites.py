"""Places of a module where one small change makes it wrong, and the module with that change."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

COMPARED: dict[type, type] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
COMPUTED: dict[type, type] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift, ast.RShift: ast.LShift,
}  # fmt: skip


_Path = tuple[tuple[str, int | None], ...]


@dataclass(frozen=True, eq=False)
class Mutant:
    """A module with one change.

    line : of the change; place : that line's text
    change : the expression or statement before and after it
    """

    line: int
    place: str
    change: str
    tree: ast.Module
    path: _Path
    node: Any

    @property
    def source(self) -> str:
        """The whole module, without its comments."""
        whole = copy.deepcopy(self.tree)
        _put(whole, self.path, self.node)
        return ast.unparse(ast.fix_missing_locations(whole))


def mutants(source: str) -> Iterator[Mutant]:
    """Every mutant of a module: comparisons, arithmetic, and/or, not, signs, numbers, truths, conditions, statements.

    Docstrings, annotations, decorators, messages of `raise` and what stands under `if TYPE_CHECKING` stay as they are.
    """
    tree, lines = ast.parse(source), source.splitlines()
    for path in _places(tree):
        node = _at(tree, path)
        for changed in _changes(node):
            before, after = (" ".join(ast.unparse(each).split())[:100] for each in (node, changed))
            yield Mutant(node.lineno, lines[node.lineno - 1].strip(), f"{before} -> {after}", tree, path, changed)


def _places(node: ast.AST, path: _Path = ()) -> Iterator[_Path]:
    """Paths from the root to all nodes that may be changed."""
    if isinstance(node, ast.Raise) or (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
        return
    if path:
        yield path
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_comment"):
            continue
        if isinstance(value, ast.AST):
            yield from _places(value, (*path, (name, None)))
        elif isinstance(value, list):
            for i, each in enumerate(value):
                if isinstance(each, ast.AST) and not (
                    isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)
                ):
                    yield from _places(each, (*path, (name, i)))


def _changes(node: Any) -> Iterator[Any]:
    """Wrong forms of a node."""
    if isinstance(node, ast.Compare):
        for i, op in enumerate(node.ops):
            ops = [*node.ops[:i], COMPARED[type(op)](), *node.ops[i + 1 :]]
            yield ast.copy_location(ast.Compare(node.left, ops, node.comparators), node)
    elif isinstance(node, ast.BinOp) and type(node.op) in COMPUTED and not _is_text(node):
        yield ast.copy_location(ast.BinOp(node.left, COMPUTED[type(node.op)](), node.right), node)
    elif isinstance(node, ast.AugAssign) and type(node.op) in COMPUTED:
        yield ast.copy_location(ast.AugAssign(node.target, COMPUTED[type(node.op)](), node.value), node)
    elif isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield ast.copy_location(ast.BoolOp(other, node.values), node)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub, ast.Invert)):
        yield node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float)):
        wrong = not node.value if isinstance(node.value, bool) else node.value + 1
        yield ast.copy_location(ast.Constant(wrong), node)
    elif isinstance(node, (ast.If, ast.While)) and isinstance(node.test, (ast.Name, ast.Attribute, ast.Call)):
        turned = copy.deepcopy(node)
        turned.test = ast.copy_location(ast.UnaryOp(ast.Not(), node.test), node.test)
        yield turned
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield ast.copy_location(ast.Pass(), node)


def _is_text(node: ast.BinOp) -> bool:
    return any(
        isinstance(side, ast.JoinedStr) or isinstance(getattr(side, "value", None), str)
        for side in (node.left, node.right)
    )


def _at(tree: Any, path: _Path) -> Any:
    for name, i in path:
        tree = getattr(tree, name) if i is None else getattr(tree, name)[i]
    return tree


def _put(tree: Any, path: _Path, node: Any) -> None:
    *above, (name, i) = path
    parent = _at(tree, tuple(above))
    if i is None:
        setattr(parent, name, node)
    else:
        getattr(parent, name)[i] = node
