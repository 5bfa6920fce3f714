"""Models of rates, one file each; a model imported here is registered."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from calibration.estimating.rate_model import RateModel
from kinetics.support.families import members

from calibration.estimating.models.mass_action_rates import MassActionRates
from calibration.estimating.models.weibull import Weibull
from calibration.estimating.models.crowded import Crowded

RATE_MODELS: tuple[RateModel, ...] = tuple(kind() for kind in members(globals(), RateModel))


def rate_model(name: str) -> RateModel:
    """The model of rates of this name. ValueError: there is none.

    >>> from calibration import rate_model
    >>> rate_model("crowded").terms
    ('k', 'c')
    """
    known = {model.name: model for model in RATE_MODELS}
    if name not in known:
        raise ValueError(f"unknown model of rates {name!r}; expected one of {', '.join(known)}")
    return known[name]
