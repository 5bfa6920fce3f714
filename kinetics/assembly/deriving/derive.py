"""Derivation: the reaction network of a rule book, with the structures behind its species."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.assembly.deriving.explore import MAX_SPECIES, Exploration, Join, StructureEvent, explore
from kinetics.assembly.deriving.ways import RateClass
from kinetics.assembly.rules.rule_book import LivelockError, RuleBook
from kinetics.assembly.structure import Structure
from kinetics.network import Network
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.shown import on_axes

if TYPE_CHECKING:
    from kinetics.assembly.drawing.drawing import Drawing

SIZE_NAMES = (
    *("monomer", "dimer", "trimer", "quadmer", "pentamer"),
    *("hexamer", "heptamer", "octamer", "nonamer", "decamer"),
)


@dataclass(frozen=True, eq=False)
class Derivation:
    """A derived network with the structures behind its species.

    structures : species name -> its canonical structure, by size
    events : the event of each channel, joins first, then breaks, with its ways by rate class
    beyond : the smallest join that went beyond the caps and was left out; None if there is none
    stopped : why the exploration ended early; "" if it did not
    """

    book: RuleBook
    structures: Mapping[str, Structure]
    events: Mapping[StructureEvent, Mapping[RateClass, float]]
    beyond: Join | None = None
    stopped: str = ""

    @property
    def is_closed(self) -> bool:
        """Whether the network is proven to be all that free cubes can become."""
        return self.beyond is None and not self.stopped

    @property
    def rate_classes(self) -> tuple[RateClass, ...]:
        """All rate classes, joins before breaks. A channel's rate is the sum over its classes of ways x constant."""
        found = {rate_class for ways in self.events.values() for rate_class in ways}
        return tuple(sorted(found, key=lambda c: (c.event != "join", c)))

    @cached_property
    def network(self) -> Network:
        """The reaction network, without rate constants.

        N of a join counts pairs of open faces, each of the four twists as a quarter (a like pair of structures is one
        pair); N of a break counts the bonds that break so.
        """
        structures = list(self.structures.values())
        sizes = [len(structure) for structure in structures]
        names = list(self.structures)
        short = [str(size) if sizes.count(size) == 1 else name for size, name in zip(sizes, names, strict=True)]
        shape = (len(self.events), len(names))
        entries = [(r, s, made) for r, event in enumerate(self.events) for made in (0, 1) for s in event[made]]
        channel, species, is_made = np.array(entries, dtype=np.int64).reshape(-1, 3).T
        needed = is_made == 0
        return Network(
            tuple(names),
            tuple("->".join("+".join(short[s] for s in side) for side in event) for event in self.events),
            SparseTable.of_entries(shape, channel[needed], species[needed], np.ones(needed.sum(), dtype=np.int64)),
            SparseTable.of_entries(shape, channel, species, 2 * is_made - 1),
            np.array([sum(ways.values()) for ways in self.events.values()], dtype=float),
            conserved={"cubes": np.array(sizes, dtype=float)},
            time_unit="tu",
        )

    def species_of(self, structure: Structure) -> int:
        """Index of the species of a structure, in any placement and orientation."""
        canonical = structure.canonical(self.book.scheme)
        if canonical not in self._species:
            raise KeyError(f"{canonical} is not among the {len(self.structures)} species of book {self.book.name!r}")
        return self._species[canonical]

    def channel(self, before: Sequence[int], after: Sequence[int]) -> int:
        """Index of the channel that turns species `before` into species `after` (indices in any order)."""
        key = StructureEvent(tuple(sorted(before)), tuple(sorted(after)))
        if key not in self._channels:
            sides = (" + ".join(self.network.species[s] for s in side) for side in key)
            raise KeyError(f"no channel of book {self.book.name!r} turns {' into '.join(sides)}")
        return self._channels[key]

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Draw the network as a graph; a large one is lumped by size. Returns `ax`."""
        return self.drawing().onto(ax)

    def drawing(self, **options: Any) -> Drawing:
        """The network as a graph; options as in `network_diagram.network_drawing`."""
        from kinetics.assembly.drawing.network_diagram import DrawnChannel, network_drawing

        channels = [DrawnChannel(*event, sum(ways.values())) for event, ways in self.events.items()]
        return network_drawing(self.structures, channels, self.book.scheme, self.is_closed, **options)

    @cached_property
    def _species(self) -> dict[Structure, int]:
        return {structure: index for index, structure in enumerate(self.structures.values())}

    @cached_property
    def _channels(self) -> dict[StructureEvent, int]:
        return {event: channel for channel, event in enumerate(self.events)}


def derive(
    book: RuleBook,
    max_cubes: int | None = None,
    max_species: int = MAX_SPECIES,
    partial: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Derivation:
    """Derive the network of everything that free cubes, and the seed if there is one, can become under a rule book.

    max_cubes, max_species : caps; a ValueError names the smallest join that leads beyond them. max_cubes is by default
        12, or the target's size if that is larger
    partial : leave out what lies beyond the caps instead of raising; see `beyond` and `stopped` of the result, also
        after Ctrl-C

    Only bonds outside loops break.
    """
    found = explore(book, max_cubes, max_species, first_beyond=not partial, progress=progress)
    if found.livelocks:
        raise LivelockError(found.livelocks[0])
    if not partial:
        _refuse_open(found)
    return named(found)


def _refuse_open(found: Exploration) -> None:
    """ValueError if the exploration is no proof."""
    if found.beyond is not None:
        a, b, made = found.beyond
        raise ValueError(
            f"book {found.book.name!r} is not closed under max_cubes = {found.max_cubes}: the join of {a} and {b} has "
            f"{len(made)} cubes; guard the rules against it, or raise the cap"
        )
    if found.stopped.startswith("interrupted"):
        raise KeyboardInterrupt
    if found.stopped:
        raise ValueError(found.stopped)


def named(found: Exploration) -> Derivation:
    """The derivation with names, species sorted by size and channels by the structures that they make or take."""
    structures = sorted(found.structures, key=lambda s: (len(s), s.positions, s.rotations, s.letters))
    place = {structure: index for index, structure in enumerate(structures)}
    new_index = [place[structure] for structure in found.structures]
    events = {
        StructureEvent(*(tuple(sorted(new_index[s] for s in side)) for side in event)): ways
        for event, ways in found.events.items()
    }
    joined = sorted((e for e in events if len(e.before) == 2), key=lambda e: (e.after, e.before))
    broken = sorted(e for e in events if len(e.before) == 1)
    return Derivation(
        found.book,
        dict(zip(_names(structures, found.book), structures, strict=True)),
        {event: events[event] for event in (*joined, *broken)},
        found.beyond,
        found.stopped,
    )


def _names(structures: Sequence[Structure], book: RuleBook) -> list[str]:
    """A name for each structure: by its size, with a letter if several have that size."""
    seed = book.seed()
    is_seed = [seed is not None and s == seed.canonical(book.scheme) for s in structures]
    sizes = [0 if apart else len(s) for s, apart in zip(structures, is_seed, strict=True)]
    counts = {size: sizes.count(size) for size in set(sizes)}
    numbers: dict[int, int] = dict.fromkeys(sizes, 0)
    names = []
    for size in sizes:
        names.append(_name(size, numbers[size], counts[size]) if size else "seed")
        numbers[size] += 1
    return names


def _name(size: int, number: int, alike: int) -> str:
    """`trimer`, or `trimer.b` if several species have that size: .a to .z, .aa and on."""
    name = SIZE_NAMES[size - 1] if size <= len(SIZE_NAMES) else f"{size}-mer"
    if alike == 1:
        return name
    suffix = ""
    while number >= 0:
        number, letter = divmod(number, 26)
        suffix = chr(ord("a") + letter) + suffix
        number -= 1
    return f"{name}.{suffix}"
