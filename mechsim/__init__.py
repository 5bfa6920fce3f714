"""Rigid-body mechanics of the cubes: scenes, runs, ensembles and their store. Names are imported on first use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from mechsim.inspection.pictures.tank import draw_tank as draw_tank
    from mechsim.runs.ensemble import Outcome as Outcome
    from mechsim.runs.ensemble import Quarantined as Quarantined
    from mechsim.runs.ensemble import run_all as run_all
    from mechsim.runs.executors import Dask as Dask
    from mechsim.runs.executors import Processes as Processes
    from mechsim.runs.record import RunRecord as RunRecord
    from mechsim.runs.record import RunSpec as RunSpec
    from mechsim.runs.record import execute as execute
    from mechsim.runs.store import RunStore as RunStore
    from mechsim.scene import Scene as Scene

__project__ = "wellmixed"  # by which the command knows that this is ours

__getattr__, __dir__ = lazy_names(__name__)
