"""How crowds change rates, in a rates file: a model for each source of events, and the geometry of bodies."""

from __future__ import annotations

import numpy as np
from msgspec import field

from kinetics.network import Crowding, Tank
from kinetics.rates.breaks import Expansion
from kinetics.rates.crowding import SOURCES, ConvexBodies, crowding_in, crowding_model
from kinetics.rates.crowding.base import SourceName
from kinetics.support.settings import Positive, Settings


class BodyGeometry(Settings):
    """One species as a convex body: mean radius of curvature, surface and volume, in the unit of the tank's edges."""

    radius: Positive
    surface: Positive
    volume: Positive


class CrowdingTerms(Settings):
    """The models of crowding of a rates file.

    bodies, walls : of breaks by bodies and by walls; joins : of joins. Names of models of crowding
    shape : source -> the parameters of its model
    species : the geometry of each species

    >>> from kinetics.rates import CrowdingTerms
    >>> CrowdingTerms(walls="three-body", shape={"walls": {"third": 0.6}}).walls
    'three-body'
    """

    bodies: str = "none"
    walls: str = "none"
    joins: str = "none"
    shape: dict[str, dict[str, float]] = field(default_factory=dict)
    species: dict[str, BodyGeometry] = field(default_factory=dict)

    def __post_init__(self) -> None:
        models = self.models
        if set(self.shape) - set(models):
            raise ValueError(f"crowding has parameters for {', '.join(self.shape)}; expected {', '.join(models)}")
        for source, name in models.items():
            wanted = {parameter.name: parameter for parameter in crowding_model(name).parameters}
            found = self.shape.get(source, {})
            if set(found) != set(wanted):
                raise ValueError(
                    f"model of crowding {name!r} for {source} has the parameters {', '.join(wanted) or 'none'}; "
                    f"{', '.join(found) or 'none'} came"
                )
            for key, value in found.items():
                low, high = wanted[key].low, wanted[key].high
                if not low <= value <= high:
                    raise ValueError(f"{key} = {value:g} of crowding for {source}; expected {low:g} to {high:g}")

    @property
    def models(self) -> dict[SourceName, str]:
        """Source -> name of its model."""
        return {source: getattr(self, source) for source in SOURCES}

    def crowding(self, expansion: Expansion, tank: Tank) -> Crowding | None:
        """The factors of a network in a tank; None if there are none. ValueError: a species without geometry."""
        if set(self.models.values()) == {"none"}:
            return None
        missing = [name for name in expansion.network.species if name not in self.species]
        if missing:
            raise ValueError(
                f"crowding knows no geometry of {', '.join(missing[:8])}; expected radius, surface and volume of every "
                "species of the network: calibrate again with its rule book"
            )
        shapes = [self.species[name] for name in expansion.network.species]
        bodies = ConvexBodies(*np.array([(each.radius, each.surface, each.volume) for each in shapes]).T)
        choice = {source: (crowding_model(name), self.shape.get(source, {})) for source, name in self.models.items()}
        return crowding_in(expansion, bodies, tank, choice)
