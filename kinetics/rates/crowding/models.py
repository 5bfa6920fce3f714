"""Models of crowding, one file each; a model imported here is registered."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from kinetics.rates.crowding.base import CrowdingModel
from kinetics.support.families import member_named, members

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
    return member_named(name, CROWDING_MODELS, "model of crowding")
