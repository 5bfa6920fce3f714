"""Records of runs: jump paths, ensembles of counts, and first times."""

from kinetics.runs.first_times import FirstTimes
from kinetics.runs.paths import BY_SEVERAL, BY_UNKNOWN, BY_WALL, NO_BREAK, RESTART, Ensemble, JumpPath
from kinetics.runs.truncation import TruncatedRunsError, Truncation

__all__ = [
    "BY_SEVERAL",
    "BY_UNKNOWN",
    "BY_WALL",
    "NO_BREAK",
    "RESTART",
    "Ensemble",
    "FirstTimes",
    "JumpPath",
    "TruncatedRunsError",
    "Truncation",
]
