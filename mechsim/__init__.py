"""How cubes move: scenes, runs, ensembles and their store. Names are imported when they are first used."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.late import late_names

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

__getattr__ = late_names(__name__, _HOMES)
