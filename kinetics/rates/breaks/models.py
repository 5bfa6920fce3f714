"""Break models, one file each; a model imported here is registered."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from kinetics.rates.breaks.base import BreakModel
from kinetics.support.families import member_named, members

from kinetics.rates.breaks.first_order import FirstOrder
from kinetics.rates.breaks.collision import Collision
from kinetics.rates.breaks.collision_wall import CollisionWall
from kinetics.rates.breaks.collision_species import CollisionSpecies

BREAK_MODELS: tuple[BreakModel, ...] = tuple(kind() for kind in members(globals(), BreakModel))


def break_model(name: str) -> BreakModel:
    """The break model of this name. ValueError: there is none.

    >>> from kinetics import break_model
    >>> break_model("first-order").name
    'first-order'
    """
    return member_named(name, BREAK_MODELS, "break model")
