"""How cubes move: scenes, runs, ensembles and their store. Names are imported when they are first used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mechsim.ensemble import Outcome, Quarantined, run_all
    from mechsim.executors import Dask, Processes
    from mechsim.pictures.tank import draw_tank
    from mechsim.record import RunRecord, RunSpec, execute
    from mechsim.scene import Scene
    from mechsim.store import RunStore

_HOMES = {
    "mechsim.ensemble": ("Outcome", "Quarantined", "run_all"),
    "mechsim.executors": ("Dask", "Processes"),
    "mechsim.record": ("RunRecord", "RunSpec", "execute"),
    "mechsim.pictures.tank": ("draw_tank",),
    "mechsim.scene": ("Scene",),
    "mechsim.store": ("RunStore",),
}

__all__ = [
    "Dask",
    "Outcome",
    "Processes",
    "Quarantined",
    "RunRecord",
    "RunSpec",
    "RunStore",
    "Scene",
    "draw_tank",
    "execute",
    "run_all",
]


def __getattr__(name: str) -> Any:
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module 'mechsim' has no attribute {name!r}")
