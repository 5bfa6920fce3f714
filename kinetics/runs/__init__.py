"""What happened: jump paths, ensembles of runs, and their statistics."""

from kinetics.runs.paths import RESTART, Ensemble, JumpPath
from kinetics.runs.statistics import EnsembleStatistics

__all__ = ["RESTART", "Ensemble", "EnsembleStatistics", "JumpPath"]
