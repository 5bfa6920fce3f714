"""A rule book compiled into a per-face grammar: each face of a cube holds a letter of its own and rewrites it itself.

So do graph grammars of self-assembly (Klavins, Ghrist and Lipsky 2006, doi:10.1109/TAC.2006.876950), against which
section II of the paper holds its one state a cube. A face's letter is the cube's letter and the type of the face, as
`c.f2`. Every rule becomes one production for each type of face: a face reads its own letter and, through its cube, what
the cube reads as it bonds or follows. The grammar makes the same structures as the book, move for move.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from kinetics.assembly.faces import roll, scheme_of
from kinetics.assembly.rules.conditions import Rule, first_that_fits, in_order
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

FACES = range(6)
Faces = list[list[str]]  # [cube][own face] -> letter


class Rewriting(NamedTuple):
    """What a move does to the faces of a cube: new letters by face, of those that change; each face looks up once."""

    cube: int
    letters: Mapping[int, str]


def letter_of(face_letter: str) -> str:
    """The cube's letter that a face's letter stands for."""
    return face_letter.rsplit(".", 1)[0]


@dataclass(frozen=True)
class FaceGrammar:
    """The per-face grammar of a rule book. Books that write one after the other, or name finished cubes, have none."""

    book: RuleBook

    def __post_init__(self) -> None:
        semantics = self.book.semantics
        if semantics.update != "synchronous" or semantics.gate != "mutual" or semantics.finished:
            raise ValueError(
                f"book {self.book.name!r}: a per-face grammar is made of rules by which both cubes need a rule "
                "and read before either writes (gate mutual, update synchronous, nothing finished)"
            )

    @cached_property
    def productions(self) -> Mapping[tuple[str, str], tuple[Rule, ...]]:
        """(kind of rule, face type) -> the productions of such faces, in the order in which they are tried."""
        book = self.book
        return {
            (kind, face): tuple(
                rule.replace(
                    letter=tuple(f"{letter}.{face}" for letter in rule.letter or book.letters),
                    becomes=f"{rule.becomes}.{face}",
                )
                for rule in in_order(rules, book.semantics.conflict)
            )
            for kind, rules in book.rules.items()
            for face in scheme_of(book.scheme).names
        }

    @property
    def n_letters(self) -> int:
        """How many letters its faces have."""
        return len(self.book.letters) * len(scheme_of(self.book.scheme).names)

    @property
    def n_productions(self) -> int:
        """How many productions there are, of all kinds."""
        return sum(map(len, self.productions.values()))

    def faces(self, structure: Structure) -> Faces:
        """The face letters of a structure with these letters."""
        types = scheme_of(self.book.scheme).types
        return [[f"{letter}.{types[face]}" for face in FACES] for letter in structure.letters]

    def docked(
        self, faces: Faces, joined: Structure, n_first: int, one: tuple[int, int], other: tuple[int, int]
    ) -> tuple[Rewriting, Rewriting]:
        """What the faces of two cubes become as they bond.

        joined : both structures, the first of n_first cubes; faces : theirs
        one, other : (cube, own face) that dock, of the first and of the second structure
        """
        parts = (range(n_first), range(n_first, len(joined)))
        types, senses = scheme_of(self.book.scheme).types, self.book.senses
        made = []
        for (cube, face), (partner, its_face), own, theirs in ((one, other, *parts), (other, one, *parts[::-1])):
            behind = joined.cube_at(joined.faced(cube, face ^ 1)) if senses.across else None
            twist = None
            if senses.roll:
                twist = roll(self.book.scheme, joined.rotations[cube], face, joined.rotations[partner])
            reading = {
                "face": types[face],
                "partner": letter_of(faces[partner][its_face]),
                "partner_face": types[its_face],
                "neighbours": _around(faces, joined, cube, own),
                "across": "" if behind is None else letter_of(faces[behind][_towards(joined, behind, cube)]),
                "roll": twist,
                "touched": _around(faces, joined, cube, theirs) if senses.touched else None,
            }
            made.append(self._rewritten("combine", faces, cube, reading))
        first, second = made
        return first, second

    def followed(self, faces: Faces, structure: Structure, cubes: Iterable[int]) -> list[Rewriting]:
        """What the faces of some cubes become in one round of internal rules."""
        everywhere = range(len(structure))
        around = ((cube, _around(faces, structure, cube, everywhere)) for cube in cubes)
        return [self._rewritten("internal", faces, cube, {"neighbours": near}) for cube, near in around]

    def _rewritten(self, kind: str, faces: Faces, cube: int, reading: dict[str, Any]) -> Rewriting:
        types, new = scheme_of(self.book.scheme).types, {}
        for face, letter in enumerate(faces[cube]):
            rule = first_that_fits(self.productions[kind, types[face]], {"letter": letter, **reading})
            if rule is not None and rule.becomes != letter:
                new[face] = rule.becomes
        return Rewriting(cube, new)


def rewrite(faces: Faces, rewritings: Iterable[Rewriting]) -> None:
    """Write what a move makes of some faces, all at once."""
    for cube, letters in rewritings:
        for face, letter in letters.items():
            faces[cube][face] = letter


def _around(faces: Faces, structure: Structure, cube: int, among: Sequence[int]) -> tuple[str, ...]:
    """What a cube reads of those that it touches: the letters of the faces that look at it."""
    near = (other for other in structure.touching(structure.positions[cube]) if other in among)
    return tuple(sorted(letter_of(faces[other][_towards(structure, other, cube)]) for other in near))


def _towards(structure: Structure, cube: int, other: int) -> int:
    return structure.face_towards(cube, structure.positions[other])
