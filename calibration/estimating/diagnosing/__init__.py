"""Diagnostics of runs, one file each; a diagnostic imported here is used wherever runs are diagnosed."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from calibration.estimating.diagnosing.base import Diagnostic
from kinetics.support.families import members

from calibration.estimating.diagnosing.waits import Waits
from calibration.estimating.diagnosing.drift import Drift
from calibration.estimating.diagnosing.between_runs import BetweenRuns
from calibration.estimating.diagnosing.ages import Ages
from calibration.estimating.diagnosing.starts import Starts
from calibration.estimating.diagnosing.sizes import Sizes
from calibration.estimating.diagnosing.crowds import Crowds
from calibration.estimating.diagnosing.rebinding import Rebinding

DIAGNOSTICS: tuple[Diagnostic, ...] = tuple(kind() for kind in members(globals(), Diagnostic))
