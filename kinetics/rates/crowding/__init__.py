"""How crowds change rates: models by name, and the geometry of bodies that they need."""

from kinetics.rates.crowding.base import SOURCES, CrowdingModel, crowding_in
from kinetics.rates.crowding.bodies import ConvexBodies
from kinetics.rates.crowding.models import CROWDING_MODELS, crowding_model
from kinetics.rates.crowding.three_body import THIRD

__all__ = [
    "CROWDING_MODELS",
    "SOURCES",
    "THIRD",
    "ConvexBodies",
    "CrowdingModel",
    "crowding_in",
    "crowding_model",
]
