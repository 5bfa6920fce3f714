"""Executors, which make the runs of an ensemble; one imported here is registered, and the first is the default."""

from mechsim.runs.executors.base import Executor, RunAttempt, Session
from mechsim.runs.executors.cluster import Dask
from mechsim.runs.executors.processes import Processes

EXECUTORS: tuple[type[Executor], ...] = (Processes, Dask)

__all__ = ["EXECUTORS", "Dask", "Executor", "Processes", "RunAttempt", "Session"]
