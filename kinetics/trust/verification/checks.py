"""The tuple of all checks of a sampler, read by `verify`, its report and the contract tests."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from __future__ import annotations

from kinetics.support.families import members
from kinetics.trust.verification.base import SamplerCheck

# To add one, see `SamplerCheck`.
from kinetics.trust.verification.each_time import EachTime
from kinetics.trust.verification.transitions import BetweenTimes
from kinetics.trust.verification.rate_scores import RateScores
from kinetics.trust.verification.repeated_runs import RepeatedRuns
from kinetics.trust.verification.correlated_runs import CorrelatedRuns
from kinetics.trust.verification.path_waits import PathWaits
from kinetics.trust.verification.path_choices import PathChoices
from kinetics.trust.verification.paths_agree import PathsAgree

SAMPLER_CHECKS: tuple[type[SamplerCheck], ...] = members(globals(), SamplerCheck)
