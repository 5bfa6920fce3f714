"""Lazy imports: names of a package that are imported when they are first used."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any


def lazy_names(
    package: str, public: Sequence[str], homes: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` (PEP 562) of a package whose public names are imported on demand.

    public : `__all__` of the package
    homes : module -> those of the names that live there
    """
    home_of = {name: module for module, names in homes.items() for name in names}

    def find(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}; {_hint(name, package, public)}")
        return getattr(importlib.import_module(home_of[name]), name)

    return find, lambda: sorted(public)


def _hint(name: str, package: str, public: Sequence[str]) -> str:
    """Public names that are spelled nearly so or contain the name, in any case, and where all of them are listed."""
    spelled = {each.lower(): each for each in public}
    sought = name.lower()
    near = [*difflib.get_close_matches(sought, spelled, n=3), *(each for each in spelled if sought in each)]
    names = " or ".join(repr(spelled[each]) for each in dict.fromkeys(near))
    where = f"he public names are those of dir({package})"
    return f"did you mean {names}? T{where}" if near else f"t{where}"
