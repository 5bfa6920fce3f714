"""Packages that come with an extra: imported if they are used, with a message that says how to install them."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

# package that may be lacking -> what pip installs it by, as the extras of pyproject.toml have it
EXTRAS = {
    "pybullet": "pybullet>=3.2.6",
    "pandas": "pandas>=2.2",
    "pyarrow": "pyarrow>=18",
    "xarray": "xarray>=2025.1",
    "arviz": "arviz>=0.23,<1",
    "matplotlib": "matplotlib>=3.9",
    "distributed": "distributed>=2026.8",
    "imageio_ffmpeg": "imageio-ffmpeg>=0.6",
    "plotly": "plotly>=6.0",
    "libsbml": "python-libsbml>=5.20",
    "antimony": "antimony>=3.0",
    "bionetgen": "bionetgen>=0.8.7",
}
# what goes without such a package
INSTEAD = {"pybullet": 'or choose an engine without this dependency in the scene: engine = "own" under [numerics]'}


def how_to_install(name: str) -> str:
    """What a user without this package does."""
    install = f"this needs {name}; install it by: pip install '{EXTRAS[name]}'"
    return f"{install}, {INSTEAD[name]}" if name in INSTEAD else install


def require(name: str) -> str:
    """The file of a package that another process will import; the same error as `extra` if there is none."""
    found = find_spec(name)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(how_to_install(name), name=name)
    return found.origin


def extra(name: str) -> Any:
    """The package of this name; a ModuleNotFoundError that says how to install it."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise ModuleNotFoundError(how_to_install(name), name=name) from None
