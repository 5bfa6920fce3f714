"""The effects that a scene may list; an effect imported here is registered."""

# ruff: noqa: F401 - the imports are the list

from functools import reduce
from operator import or_
from typing import Any

from kinetics.support.families import members
from mechsim.effects.agitation import Agitation
from mechsim.effects.attraction import Attraction
from mechsim.effects.base import Effect
from mechsim.effects.bonding import Bonding
from mechsim.effects.breaking import Breaking
from mechsim.effects.buoyancy import Buoyancy
from mechsim.effects.contact import Contact
from mechsim.effects.current import Current
from mechsim.effects.drag import Drag
from mechsim.effects.ornstein_uhlenbeck import OrnsteinUhlenbeck
from mechsim.effects.random_field import RandomField
from mechsim.effects.shear import Shear
from mechsim.effects.walls import Walls

EFFECTS: tuple[type[Effect], ...] = members(globals(), Effect)

AnyEffect: Any = reduce(or_, EFFECTS)
