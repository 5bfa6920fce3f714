"""The effects a scene may list."""

from functools import reduce
from operator import or_
from typing import Annotated, Any

from pydantic import Field

from mechsim.effects.agitation import Agitation
from mechsim.effects.bonding import Bonding
from mechsim.effects.breaking import Breaking
from mechsim.effects.contact import Contact
from mechsim.effects.drag import Drag
from mechsim.effects.walls import Walls

EFFECTS = (Agitation, Drag, Walls, Contact, Breaking, Bonding)

AnyEffect: Any = Annotated[reduce(or_, EFFECTS), Field(discriminator="effect")]

__all__ = ["EFFECTS", "Agitation", "AnyEffect", "Bonding", "Breaking", "Contact", "Drag", "Walls"]
