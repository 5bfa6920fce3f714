"""Hits: what a collision did to one body in one step."""

from __future__ import annotations

from dataclasses import dataclass

from kinetics.assembly import Structure


@dataclass(frozen=True, eq=False)
class Hit:
    """The load on the most loaded bond of a body, and who struck.

    slot, born : the struck body, and the time at which it got its structure, tu
    struck : its structure
    bond : its most loaded bond, two indices of cubes in the structure
    load : in the unit of the criterion by which bonds break
    partner_slot, partner : the body that struck, or -1 and None for a wall; of several, that of the largest impulse
    is_shared : several bodies or walls touched it in this step
    breaks : the bond breaks
    """

    slot: int
    born: float
    struck: Structure
    bond: tuple[int, int]
    load: float
    partner_slot: int
    partner: Structure | None
    is_shared: bool
    breaks: bool
