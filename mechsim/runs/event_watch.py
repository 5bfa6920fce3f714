"""What a run records of its events: each join and break as a channel of the network, and hits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kinetics.assembly import Derivation, Structure
from kinetics.runs import BY_SEVERAL, BY_UNKNOWN, BY_WALL, NO_BREAK
from mechsim.effects.hits import Hit
from mechsim.runs.load_log import LoadLog

if TYPE_CHECKING:
    from mechsim.world.world import BondEvent


@dataclass(frozen=True)
class RunEvent:
    """An event of a run: its time, tu, its channel or RESTART, the two cubes of the bond, and what broke it."""

    time: float
    channel: int
    bond: tuple[int, int] = (-1, -1)
    partner: int = NO_BREAK


class EventWatch:
    """Turns the world's joins and partings into channels of the network; notes the first copy of a species."""

    def __init__(self, derivation: Derivation, composition: dict[str, int], until: str | None):
        self.derivation = derivation
        self.initial = derivation.network.state(composition)
        self.events: list[RunEvent] = []
        self.log = LoadLog()
        self.step, self.time = 0, 0.0
        self.until = None if until is None else derivation.network.index(until)
        self.is_reached = False

    def __call__(self, event: BondEvent) -> None:
        """Note a bond that was made or broken."""
        species, hit = self.derivation.species_of, event.hit
        made = [species(s) for s in event.after]
        channel = self.derivation.channel([species(s) for s in event.before], made)
        if len(event.before) > 1:
            partner = NO_BREAK
        elif hit is None:
            partner = BY_UNKNOWN
        elif hit.is_shared:
            partner = BY_SEVERAL
        else:
            partner = BY_WALL if hit.partner is None else species(hit.partner)
        self.events.append(RunEvent(self.time, channel, event.cubes, partner))
        self.is_reached |= self.until in made

    def log_hit(self, hit: Hit) -> None:
        """Note a hit in the log of loads."""
        self.log.add(self.step, self.time, hit)

    def break_channel(self, structure: Structure, bond: tuple[int, int]) -> int:
        """The channel of the break of this bond (two indices of cubes)."""
        species = self.derivation.species_of
        parts = self.derivation.book.break_bond(structure, *bond)
        return self.derivation.channel([species(structure)], [species(part) for _, part in parts])
