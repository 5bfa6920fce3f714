"""Network-free simulation: assembly directly from the rules of a book, without deriving its network."""

from kinetics.networkfree.growth import Growth, Growths
from kinetics.networkfree.paths import growth_of
from kinetics.networkfree.simulate import grow

__all__ = ["Growth", "Growths", "grow", "growth_of"]
