"""Mirror images that rules cannot tell apart: the same shape, with letters that are each other's mirror image.

Cubes with one or two face types cannot tell left from right, so a growth that puts letters onto a shape may put their
mirror image there as well. Where the shape is its own mirror image, both are the same finished thing.
"""

from __future__ import annotations

from kinetics.assembly.structure import Structure

LEFT_AND_RIGHT = ("six",)  # face schemes by which cubes can tell them


def mirrored(structure: Structure) -> Structure:
    """The mirror image about the plane x = 0, as cubes see it whose faces are known by their axis alone."""
    places = tuple((-x, y, z) for x, y, z in structure.positions)
    return Structure.unchecked(places, structure.rotations, structure.letters)


def same_to_rules(made: Structure, wanted: Structure, scheme: str) -> bool:
    """Whether a structure is another one, or has its shape and the mirror image of its letters, unseen by the rules.

    A mirror image of another shape is another structure: a left-handed screw is no right-handed one.
    """
    if len(made) != len(wanted):
        return False
    canonical = wanted.canonical(scheme)
    if made.canonical(scheme) == canonical:
        return True
    if scheme in LEFT_AND_RIGHT or mirrored(made).canonical(scheme) != canonical:
        return False
    bare = ("",) * len(wanted)
    return made.with_letters(bare).canonical(scheme) == wanted.with_letters(bare).canonical(scheme)
