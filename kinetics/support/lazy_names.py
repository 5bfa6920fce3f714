"""Lazy imports: names of a package that are imported when they are first used."""

from __future__ import annotations

import ast
import difflib
import importlib
import sys
from collections.abc import Callable
from functools import cache
from typing import Any


def lazy_names(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` (PEP 562) of a package whose public names are imported on demand.

    Its source declares them once, in the form by which type checkers see that they are public: every `from module
    import name as name`, below `if TYPE_CHECKING` or made at once. They and its version are its `__all__`.
    What a package imports of itself are modules.
    """

    @cache
    def homes() -> dict[str, str]:
        loader: Any = sys.modules[package].__loader__
        return homes_in(loader.get_source(package))

    def public() -> list[str]:
        return sorted([*homes(), *({"__version__"} & vars(sys.modules[package]).keys())])

    def find(name: str) -> Any:
        if name == "__all__":
            return public()
        if name not in homes():
            raise AttributeError(f"module {package!r} has no attribute {name!r}; {_hint(name, package, public())}")
        home = homes()[name]
        return (
            importlib.import_module(f"{home}.{name}")
            if home == package
            else getattr(importlib.import_module(home), name)
        )

    return find, public


def homes_in(source: str) -> dict[str, str]:
    """Public name -> the module that it lives in, read off the source of a package."""
    found = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom)]
    return {each.name: str(node.module) for node in found for each in node.names if each.name == each.asname}


def _hint(name: str, package: str, public: list[str]) -> str:
    """Public names that are spelled nearly so or contain the name, in any case, and where all of them are listed."""
    spelled = {each.lower(): each for each in public}
    sought = name.lower()
    near = [*difflib.get_close_matches(sought, spelled, n=3), *(each for each in spelled if sought in each)]
    names = " or ".join(repr(spelled[each]) for each in dict.fromkeys(near))
    where = f"he public names are those of dir({package})"
    return f"did you mean {names}? T{where}" if near else f"t{where}"
