"""Models of crowding, one file each; a model imported here is registered."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from kinetics.rates.crowding.base import CrowdingModel
from kinetics.support.families import members

from kinetics.rates.crowding.none import NoCrowding
from kinetics.rates.crowding.linear import Linear
from kinetics.rates.crowding.hard_bodies import HardBodies
from kinetics.rates.crowding.three_body import ThreeBody

CROWDING_MODELS: tuple[CrowdingModel, ...] = tuple(kind() for kind in members(globals(), CrowdingModel))


def crowding_model(name: str) -> CrowdingModel:
    """The model of crowding of this name. ValueError: there is none.

    >>> from kinetics.rates.crowding import crowding_model
    >>> crowding_model("hard-bodies").name
    'hard-bodies'
    """
    known = {model.name: model for model in CROWDING_MODELS}
    if name not in known:
        raise ValueError(f"unknown model of crowding {name!r}; expected one of {', '.join(known)}")
    return known[name]
