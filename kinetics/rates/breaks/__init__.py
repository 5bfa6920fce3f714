"""How bonds break: models by name, and the networks that they make of a rule book's."""

from kinetics.rates.breaks.base import ALONE, WALL, BreakModel, ShapeParameter, SizeWeights
from kinetics.rates.breaks.expansion import Expansion, base_channel, is_break, pairs
from kinetics.rates.breaks.models import BREAK_MODELS, break_model

__all__ = [
    "ALONE",
    "BREAK_MODELS",
    "WALL",
    "BreakModel",
    "Expansion",
    "ShapeParameter",
    "SizeWeights",
    "base_channel",
    "break_model",
    "is_break",
    "pairs",
]
