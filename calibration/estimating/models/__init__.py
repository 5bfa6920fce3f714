"""Models of rates, one file each; a model imported here is registered."""

# ruff: noqa: I001 - the imports are the list, in this order

from calibration.estimating.rate_model import RateModel
from kinetics.support.families import members

from calibration.estimating.models.mass_action_rates import MassActionRates as MassActionRates
from calibration.estimating.models.weibull import Weibull as Weibull
from calibration.estimating.models.crowded import Crowded as Crowded

RATE_MODELS: tuple[RateModel, ...] = tuple(kind() for kind in members(globals(), RateModel))
