"""The tank: rates of meetings scale with one over its volume, rates of hitting its wall with surface over volume."""

from __future__ import annotations

from dataclasses import dataclass

from kinetics.support.arrays import reals
from kinetics.support.frozen import set_fields

# Of volume, surface and their ratio: the factors between two tanks, and their squares, are then numbers too.
LEAST, MOST = 1e-60, 1e60


@dataclass(frozen=True)
class Tank:
    """A box of edges `size` (3,), in the unit of length in which the parts are measured.

    ValueError: lengths that are not above 0, or a volume, a surface or their ratio outside 1e-60 to 1e60

    >>> Tank((2.0, 2.0, 3.0)).volume
    12.0
    """

    size: tuple[float, float, float]

    def __post_init__(self) -> None:
        size = reals("tank", self.size, (3,), minimum=0)
        if not (size > 0).all():
            raise ValueError(f"tank = {tuple(size.tolist())}; expected three lengths above 0, such as 2 2 3")
        set_fields(self, size=tuple(size.tolist()))
        volume, surface = self.volume, self.surface
        if not (LEAST <= volume <= MOST and LEAST <= surface <= MOST and LEAST <= surface / volume <= MOST):
            raise ValueError(
                f"tank = {self.size} has the volume {volume:.3g} and the surface {surface:.3g}; expected that both and "
                f"their ratio lie between {LEAST:g} and {MOST:g}: write its lengths in another unit"
            )

    @property
    def volume(self) -> float:
        """Product of the edges."""
        a, b, c = self.size
        return a * b * c

    @property
    def surface(self) -> float:
        """Area of the six walls."""
        a, b, c = self.size
        return 2 * (a * b + b * c + c * a)

    def dilution(self, other: Tank) -> float:
        """How much rarer a meeting of two given bodies is in the other tank: this volume over that one."""
        return self.volume / other.volume

    def wall_factor(self, other: Tank) -> float:
        """How much more often a body hits a wall in the other tank: the ratio of their surfaces over volumes."""
        return (other.surface / other.volume) / (self.surface / self.volume)

    def __str__(self) -> str:
        return " x ".join(f"{edge:g}" for edge in self.size)
