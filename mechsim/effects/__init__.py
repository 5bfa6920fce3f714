"""The effects a scene may list."""

from functools import reduce
from operator import or_
from typing import Annotated, Any

from pydantic import Field

from mechsim.effects.agitation import Agitation
from mechsim.effects.attraction import Attraction
from mechsim.effects.bonding import Bonding
from mechsim.effects.breaking import Breaking
from mechsim.effects.buoyancy import Buoyancy
from mechsim.effects.contact import Contact
from mechsim.effects.drag import Drag
from mechsim.effects.explicit_drag import ExplicitDrag
from mechsim.effects.ornstein_uhlenbeck import OrnsteinUhlenbeck
from mechsim.effects.random_field import RandomField
from mechsim.effects.walls import Walls

EFFECTS = (
    Agitation,
    OrnsteinUhlenbeck,
    RandomField,
    Buoyancy,
    Attraction,
    Drag,
    ExplicitDrag,
    Walls,
    Contact,
    Breaking,
    Bonding,
)

AnyEffect: Any = Annotated[reduce(or_, EFFECTS), Field(discriminator="effect")]

__all__ = [
    "EFFECTS",
    "Agitation",
    "AnyEffect",
    "Attraction",
    "Bonding",
    "Breaking",
    "Buoyancy",
    "Contact",
    "Drag",
    "ExplicitDrag",
    "OrnsteinUhlenbeck",
    "RandomField",
    "Walls",
]
