"""Assembly by a rule book directly, without deriving its network."""

from kinetics.networkfree.growth import Growth, Growths
from kinetics.networkfree.simulate import grow

__all__ = ["Growth", "Growths", "grow"]
