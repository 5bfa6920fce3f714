"""The order in which a book that grows from a seed builds its target: what every growth passes through."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from kinetics.assembly.deriving.explore import StructureEvent
from kinetics.assembly.deriving.mirror import same_to_rules
from kinetics.assembly.structure import Structure


def stages(structures: Sequence[Structure], events: Iterable[StructureEvent], scheme: str) -> tuple[Structure, ...]:
    """The structures at which the stages of a growth end, smallest first; the last is where all growth ends.

    structures, events : of a closed exploration, the free cube first
    A stage ends at the only structure of its size (its mirror image in letters is the same to the rules), through which
    every growth must pass, since cubes come one by one; and at one as symmetric as the last, for the first cube of a
    stage often has but one place up to symmetry.
    ValueError: the book does not grow by single cubes, or its growths end with different structures.
    """
    for event in events:
        if len(event.before) != 2 or 0 not in event.before or event.before == (0, 0):
            raise ValueError(
                "stages of growth exist only for books in which a seed binds free cubes one by one and nothing breaks"
            )
    by_size: dict[int, list[Structure]] = {}
    for structure in structures[1:]:
        by_size.setdefault(len(structure), []).append(structure)
    only = [
        alike[0]
        for size, alike in sorted(by_size.items())
        if size > 1 and all(same_to_rules(other, alike[0], scheme) for other in alike)
    ]
    if not only or len(only[-1]) < max(by_size):
        raise ValueError(f"growth ends with different structures of {max(by_size)} cubes")
    full = only[-1].symmetry_number(scheme)
    return tuple(structure for structure in only if structure.symmetry_number(scheme) == full)


def stages_in_words(ends: Sequence[Structure]) -> str:
    """`every growth passes through the same structures of 5, 25 and 45 cubes, ...`."""
    *before, last = [str(len(structure)) for structure in ends]
    if not before:
        return f"order: cubes come in any order that their hosts allow, up to {last}"
    return (
        f"order: every growth passes through the same structures of {', '.join(before)} and {last} cubes; between two "
        "of them cubes come in any order that their hosts allow"
    )
