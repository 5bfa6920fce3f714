"""Packages that come with an extra: imported where they are used, with a message that says which extra brings them."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

# package that may be lacking -> the extra that brings it
EXTRAS = {
    "pybullet": "mech",
    "pandas": "data",
    "pyarrow": "data",
    "xarray": "data",
    "arviz": "inference",
    "matplotlib": "plot",
    "distributed": "dist",
    "imageio_ffmpeg": "movie",
    "plotly": "movie",
    "libsbml": "sbml",
    "antimony": "antimony",
    "bionetgen": "bngl",
}
# what goes without such a package
INSTEAD = {"pybullet": 'or let the scene name an engine that needs nothing more: engine = "own" under [numerics]'}


def how_to_install(name: str) -> str:
    """What a user without this package does."""
    install = f"this needs {name}; install it by: pip install 'wellmixed[{EXTRAS[name]}]'"
    return f"{install}, {INSTEAD[name]}" if name in INSTEAD else install


def require(name: str) -> str:
    """The file of a package that another process will import; the same error as `extra` where there is none."""
    found = find_spec(name)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(how_to_install(name), name=name)
    return found.origin


def extra(name: str) -> Any:
    """The package of this name; a ModuleNotFoundError that says which extra brings it."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise ModuleNotFoundError(how_to_install(name), name=name) from None
