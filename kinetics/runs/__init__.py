"""Records of runs: jump paths, ensembles of counts, and their statistics."""

from kinetics.runs.paths import RESTART, Ensemble, JumpPath
from kinetics.runs.statistics import EnsembleStatistics

__all__ = ["RESTART", "Ensemble", "EnsembleStatistics", "JumpPath"]
