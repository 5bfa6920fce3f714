"""Packages of others that load slowly or come with an extra: imported when something of them is first used.

Where one is lacking, the error says how to install it.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any

__all__ = ["extra", "how_to_install", "require"]
__all__ += ["backend_agg", "libsbml", "mpl", "pd", "plt"]
__all__ += ["integrate", "linalg", "optimize", "sparse", "spatial", "special", "stats"]

# package that may be lacking -> what pip installs it by, as the extras of pyproject.toml have it
EXTRAS = {
    "pybullet": "pybullet>=3.2.6",
    "pandas": "pandas>=2.2",
    "pyarrow": "pyarrow>=18",
    "xarray": "xarray>=2025.1",
    "arviz": "arviz>=0.23",
    "emcee": "emcee>=3.1.6",
    "matplotlib": "matplotlib>=3.9",
    "distributed": "distributed>=2026.8",
    "imageio_ffmpeg": "imageio-ffmpeg>=0.6",
    "plotly": "plotly>=6.0",
    "libsbml": "python-libsbml>=5.20",
    "antimony": "antimony>=3.0",
    "bionetgen": "bionetgen>=0.8.7",
}
# where pip finds no wheel
ONLY = {"pybullet": "Python 3.11 has wheels of it, later versions build it from source"}
# what goes without such a package
INSTEAD = {"pybullet": 'or choose an engine without this dependency in the scene: engine = "own" under [numerics]'}


def how_to_install(name: str, instead: str | None = None) -> str:
    """What a user without this package does; instead: without installing it, in the place of `INSTEAD`."""
    install = f"this needs {name}; install it by: pip install '{EXTRAS[name]}'"
    install += f" ({ONLY[name]})" if name in ONLY else ""
    other = instead or INSTEAD.get(name)
    return f"{install}, {other}" if other else install


def require(name: str) -> str:
    """The file of a package that another process will import; the same error as `extra` if there is none."""
    found = find_spec(name)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(how_to_install(name), name=name)
    return found.origin


def extra(name: str) -> Any:
    """The package or module of this name; a ModuleNotFoundError that says how to install what is lacking."""
    try:
        import_module(name.partition(".")[0])  # where it is lacking, a module of it may still be loaded
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        raise ModuleNotFoundError(how_to_install(error.name), name=error.name) from None


class LateModule:
    """A module in whose place one may write its name at the top of a file: what it has is looked up at each use.

    >>> LateModule("collections").abc.Sized.__name__
    'Sized'
    """

    def __init__(self, name: str):
        self._name = name

    def __getattr__(self, part: str) -> Any:
        if part.startswith("__"):  # of a tool that inspects names
            raise AttributeError(part)
        whole = f"{self._name}.{part}"
        module = extra(self._name)
        if not hasattr(module, part):
            try:
                import_module(whole)
            except ModuleNotFoundError as error:
                if error.name != whole:
                    raise
                raise AttributeError(f"module {self._name!r} has no attribute {part!r}") from None
        found = getattr(module, part)
        return LateModule(whole) if isinstance(found, ModuleType) else found


if TYPE_CHECKING:
    import libsbml
    import matplotlib as mpl
    import matplotlib.pyplot as plt
    import pandas as pd
    from matplotlib.backends import backend_agg
    from scipy import integrate, linalg, optimize, sparse, spatial, special, stats
else:
    libsbml, mpl, plt, pd = map(LateModule, ("libsbml", "matplotlib", "matplotlib.pyplot", "pandas"))
    backend_agg = LateModule("matplotlib.backends.backend_agg")
    integrate, linalg, optimize = map(LateModule, ("scipy.integrate", "scipy.linalg", "scipy.optimize"))
    sparse, spatial, special, stats = map(LateModule, ("scipy.sparse", "scipy.spatial", "scipy.special", "scipy.stats"))
