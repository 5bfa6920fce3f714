"""Rigid-body mechanics of the cubes: scenes, runs, ensembles and their store. Names are imported on first use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from mechsim.inspection.pictures.tank import draw_tank
    from mechsim.runs.ensemble import Outcome, Quarantined, run_all
    from mechsim.runs.executors import Dask, Processes
    from mechsim.runs.record import RunRecord, RunSpec, execute
    from mechsim.runs.store import RunStore
    from mechsim.scene import Scene

__project__ = "wellmixed"  # by which the command knows that this is ours

_HOMES = {
    "mechsim.runs.ensemble": ("Outcome", "Quarantined", "run_all"),
    "mechsim.runs.executors": ("Dask", "Processes"),
    "mechsim.runs.record": ("RunRecord", "RunSpec", "execute"),
    "mechsim.inspection.pictures.tank": ("draw_tank",),
    "mechsim.scene": ("Scene",),
    "mechsim.runs.store": ("RunStore",),
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

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
