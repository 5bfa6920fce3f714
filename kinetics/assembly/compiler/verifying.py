"""The verification of seeded rule books: that they make their target and nothing else.

All configurations are explored where that is affordable, and random growths are tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kinetics.assembly.deriving.explore import explore
from kinetics.assembly.deriving.history import random_growth
from kinetics.assembly.deriving.mirror import same_to_rules
from kinetics.assembly.deriving.order import stages
from kinetics.assembly.deriving.ways import squeezes
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

MOST_STRUCTURES = 4000
GROWTHS = 500


@dataclass(frozen=True)
class Exhausted:
    """What trying every event has found.

    fault : what is wrong, in words; "" for nothing
    structures : how many there are, up to rotation
    stopped : why it is no proof; "" where it is one
    stages : where the stages of the growth end; empty where there is a fault or no proof
    """

    fault: str
    structures: int
    stopped: str
    stages: tuple[Structure, ...] = ()


def exhausted(
    book: RuleBook, most: int = MOST_STRUCTURES, progress: Callable[[int, int], None] | None = None
) -> Exhausted:
    """Try every event of a seeded book: all growth must end in the target, and no cube be squeezed in.

    A mirror image in letters alone, of which the rules see nothing, is the target as well.
    """
    assert book.target is not None  # noqa: S101  the compiler's books have one
    found = explore(book, len(book.target), most, first_beyond=True, progress=progress)
    fault = ""
    if found.beyond is not None:
        fault = f"a structure of {len(found.beyond.made)} cubes is made: {found.beyond.made}"
    elif found.livelocks:
        fault = found.livelocks[0]
    elif found.squeezed:
        fault = f"cubes are squeezed in between two others in {len(found.squeezed)} joins"
    elif not found.stopped:
        growing = {number for event in found.events for number in event.before}
        free = book.monomer().canonical(book.scheme)
        ends = [s for n, s in enumerate(found.structures) if n not in growing and s != free]
        wrong = [structure for structure in ends if not same_to_rules(structure, book.target, book.scheme)]
        if wrong:
            fault = f"growth ends with {wrong[0]}"
        elif not ends:
            fault = "growth has no end"
    is_proof = not fault and not found.stopped
    ends_of_stages = stages(found.structures, found.events, book.scheme) if is_proof else ()
    return Exhausted(fault, len(found.structures), found.stopped, ends_of_stages)


@dataclass(frozen=True)
class Grown:
    """What random growths have found.

    fault : what is wrong, in words; "" for nothing
    runs : how many there were
    squeezed : cubes that had to slip in between two others, mean over the growths
    """

    fault: str
    runs: int
    squeezed: float


def grown(book: RuleBook, runs: int, seed: int, progress: Callable[[int, int], None] | None = None) -> Grown:
    """Let a seeded book grow at random; every growth must end in the target.

    Ctrl-C after the first growth ends it; `runs` tells how many there were.
    """
    assert book.target is not None  # noqa: S101
    done, tight = 0, 0
    try:
        for run in range(runs):
            frames = random_growth(book, seed + run, len(book.target) + 1)
            if not same_to_rules(frames[-1], book.target, book.scheme):
                return Grown(f"growth {seed + run} ends with {len(frames[-1])} cubes: {frames[-1]}", run + 1, 0.0)
            tight += sum(squeezes(frame, len(frame) - 1) for frame in frames[1:])
            done += 1
            if progress is not None:
                progress(done, runs)
    except KeyboardInterrupt:
        if not done:
            raise
    return Grown("", done, tight / max(done, 1))
