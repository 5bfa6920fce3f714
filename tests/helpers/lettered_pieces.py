"""The pieces of a target with all letters that their cubes may have: how they meet, fall apart and look mirrored."""

from functools import cache
from itertools import product
from typing import NamedTuple

from kinetics.assembly.deriving.mirror import same_to_rules
from kinetics.assembly.faces import roll, scheme_of
from kinetics.assembly.structure import placements


class Meeting(NamedTuple):
    """Two pieces meet; cubes are known by their numbers, those of the second piece after those of the first.

    readings : what the two cubes read that dock
    docking : which they are
    made : the piece that would be made; None: no piece of the target
    order : of each cube its number in that piece
    """

    readings: tuple
    docking: tuple
    made: int | None
    order: tuple


class LetteredPieces:
    """The connected pieces of a target up to rotation, the free cube first and the target last.

    A piece comes with letters, cube by cube; of those that symmetry makes alike the first stands for all.
    """

    def __init__(self, target, senses, names):
        self.senses, self.scheme, self.names = senses, senses.faces, names
        self.types = scheme_of(self.scheme).types
        shapes, fresh = set(), {self.bare(target)}
        while fresh:  # every connected piece comes of leaving out one cube after another
            shapes |= fresh
            fresh = {smaller for shape in fresh for smaller in self.without_one(shape)} - shapes
        self.shapes = sorted(shapes, key=lambda shape: (len(shape), repr(shape)))
        self.number = {shape: n for n, shape in enumerate(self.shapes)}
        self.turns = [
            [tuple(shape.places[turn.of(place)] for place in shape.positions) for turn in shape.symmetries(self.scheme)]
            for shape in self.shapes
        ]
        self.first = cache(self.first)
        self.letterings = [
            sorted({self.first(piece, letters)[0] for letters in product(names, repeat=len(shape))})
            for piece, shape in enumerate(self.shapes)
        ]

    def bare(self, structure):
        return structure.with_letters(("#",) * len(structure)).canonical(self.scheme)

    def without_one(self, shape):
        for gone in range(len(shape)):
            try:
                yield self.bare(shape.part([cube for cube in range(len(shape)) if cube != gone]))
            except ValueError:  # it does not hang together
                continue

    def first(self, piece, letters):
        """The letters that stand for these, and of each cube the number of its like there."""
        images = [(tuple(letters[g.index(c)] for c in range(len(letters))), g) for g in self.turns[piece]]
        best = min(image for image, _ in images)
        alike = [g for image, g in images if image == best]
        return best, tuple(min(g[cube] for g in alike) for cube in range(len(letters)))

    def placed(self, structure):
        """Which piece it is, None for no piece of the target, and of each cube its number there."""
        bare = structure.with_letters(("#",) * len(structure))
        return self.number.get(bare.canonical(self.scheme)), bare.canonical_cubes(self.scheme)

    def followed(self, piece, letters):
        """What each cube reads while nothing meets or breaks."""
        shape = self.shapes[piece]
        return [
            (("follow",), (own,), tuple(sorted(letters[n] for n in shape.neighbours(cube))))
            for cube, own in enumerate(letters)
        ]

    def breaks(self, piece, letters):
        """(the two cubes, what they read, the parts: (piece, the cubes in its order)) of each bond that can break."""
        shape = self.shapes[piece]
        for i, j in shape.bonds:
            sides = shape.sides(i, j)
            if sides is None:
                continue
            near = [tuple(sorted(letters[n] for n in shape.neighbours(c) if n not in (i, j))) for c in (i, j)]
            readings = [(("break",), (letters[c],), near[c == j], (letters[i + j - c],)) for c in (i, j)]
            yield (i, j), readings, [self._part(shape, side) for side in sides]

    def _part(self, shape, side):
        piece, order = self.placed(shape.part(side))
        return piece, tuple(side[order.index(n)] for n in range(len(side)))

    def meetings(self, one, two):
        """Each way once."""
        first, second = (self.shapes[piece] for piece in (one, two))
        a = first.with_letters([str(n) for n in range(len(first))])
        b = second.with_letters([str(len(first) + n) for n in range(len(second))])
        found = {}
        for (i, face), (j, other) in product(a.open_faces(), b.open_faces()):
            for placed in map(b.moved, placements(a, i, face, b, j, other)):
                if a.places.keys() & placed.places.keys():
                    continue
                made, order = (None, ()) if len(a) + len(b) > len(self.shapes[-1]) else self.placed(a.joined(placed))
                readings = self.reading(a, i, placed, j), self.reading(placed, j, a, i)
                met = Meeting(readings, (i, len(a) + j), made, () if made is None else order)
                found.setdefault((met.readings, met.made, met.order), met)
        return list(found.values())

    def reading(self, own, i, other, j):
        """What a cube reads as it docks."""
        face, theirs = own.face_towards(i, other.positions[j]), other.face_towards(j, own.positions[i])
        behind = own.cube_at(own.faced(i, face ^ 1)) if self.senses.across else None
        touched = [other.letters[n] for n in other.touching(own.positions[i])] if self.senses.touched else ()
        near = tuple(own.letters[n] for n in own.neighbours(i))
        twist = roll(self.scheme, own.rotations[i], face, other.rotations[j]) if self.senses.roll else ""
        seen = "join", self.types[face], self.types[theirs], twist
        across = () if behind is None else (own.letters[behind],)
        return seen, (own.letters[i],), near, (other.letters[j],), across, tuple(touched)

    def finished_with(self, letters):
        """The letters of the target that the rules take for these: themselves, and their mirror image."""
        one = self.shapes[-1].with_letters(letters)
        others = ((other, self.shapes[-1].with_letters(other)) for other in self.letterings[-1])
        return [
            other
            for other, made in others
            if sorted(other) == sorted(letters) and same_to_rules(made, one, self.scheme)
        ]


def with_letters(reading, letters):
    """A reading by which cube has which letter."""
    seen, *rest = reading
    return seen, *(tuple(sorted(letters[int(number)] for number in numbers)) for numbers in rest)
