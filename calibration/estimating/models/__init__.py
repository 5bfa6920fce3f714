"""Models of rates, one file each; a line in `RATE_MODELS` makes one known."""

from calibration.estimating.models.crowded import Crowded
from calibration.estimating.models.mass_action_rates import MassActionRates
from calibration.estimating.models.weibull import Weibull
from calibration.estimating.rate_model import RateModel

RATE_MODELS: tuple[RateModel, ...] = (
    MassActionRates(),
    Weibull(),
    Crowded(),
)


def rate_model(name: str) -> RateModel:
    """The model of this name."""
    known = {model.name: model for model in RATE_MODELS}
    if name not in known:
        raise ValueError(f"unknown model of rates {name!r}; expected one of {', '.join(known)}")
    return known[name]
