"""Rule books: when two faces may bond, and how the cubes' letters change as bonds form and break.

A book is asked by the mechanics and by the derivation of the network alike, through the same four
functions: `view`, `allows`, `join` and `break_bond`. The rules are those of section IV of the paper, with
the choices its tables leave open made explicit in `Semantics`.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

from kinetics.assembly.conditions import (
    BookFile,
    Combination,
    Dissociation,
    Internal,
    Rule,
    Semantics,
    first_that_fits,
    in_order,
)
from kinetics.assembly.faces import scheme_of
from kinetics.assembly.structure import Placement, Structure
from kinetics.config import find, read_toml, validated

BOOKS = Path(__file__).parent / "books"


class LivelockError(ValueError):
    """Internal rules that never come to rest."""


class View(NamedTuple):
    """All that a cube may read of itself at an open face: its letter, the face's type, its neighbours' letters."""

    letter: str
    face: str
    neighbours: tuple[str, ...]


@dataclass(frozen=True)
class RuleBook:
    """Rules for cubes that all run the same state machine.

    letters : the states a cube may be in; initial : that of a free cube
    scheme : the face scheme (`two`: f1 is top and bottom, f2 the sides)
    target : the finished structure, if the book names one
    """

    name: str
    letters: tuple[str, ...]
    initial: str
    scheme: str
    target: Structure | None = None
    semantics: Semantics = field(default_factory=Semantics)
    combine: tuple[Combination, ...] = ()
    dissociate: tuple[Dissociation, ...] = ()
    internal: tuple[Internal, ...] = ()
    _tried: dict[str, tuple[Rule, ...]] = field(default_factory=dict, init=False, repr=False, compare=False)
    _allowed: dict[tuple[View, View], bool] = field(default_factory=dict, init=False, repr=False, compare=False)
    _answers: dict[Any, str | None] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._check_names()
        kinds: dict[str, tuple[Rule, ...]] = {
            "combine": self.combine,
            "dissociate": self.dissociate,
            "internal": self.internal,
        }
        for kind, rules in kinds.items():
            self._tried[kind] = in_order(rules, self.semantics.conflict)

    @classmethod
    def load(cls, name_or_path: str | Path) -> RuleBook:
        """A shipped book by its name (`line4`), or one's own TOML file."""
        path = find(name_or_path, BOOKS, "rule book")
        content = validated(BookFile, read_toml(path), path)
        fields = {name: getattr(content, name) for name in BookFile.model_fields}
        try:
            if content.target is not None:
                cubes, letters = content.target.cubes, content.target.letters
                fields["target"] = Structure(cubes, (0,) * len(cubes), letters)
            return cls(name=path.stem, **fields)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the content; the file's name and comments do not count."""
        target = self.target and (self.target.positions, self.target.rotations, self.target.letters)
        content = [self.letters, self.initial, self.scheme, target, self.semantics.model_dump()]
        rules = [[rule.model_dump() for rule in kind] for kind in (self.combine, self.dissociate, self.internal)]
        return hashlib.sha256(json.dumps([content, rules], sort_keys=True).encode()).hexdigest()

    def monomer(self) -> Structure:
        """A free cube."""
        return self.settle(Structure(((0, 0, 0),), (0,), (self.initial,)))

    def view(self, structure: Structure, cube: int, face: int) -> View | None:
        """The signature of cube's own face (0..5); None where another cube covers it."""
        if structure.cube_at(structure.faced(cube, face)) is not None:
            return None
        around = _sorted(structure.letters, structure.neighbours(cube))
        return View(structure.letters[cube], scheme_of(self.scheme).types[face], around)

    def allows(self, a: View | None, b: View | None) -> bool:
        """Whether two faces with these signatures may bond."""
        if a is None or b is None:
            return False
        if (a, b) not in self._allowed:  # the mechanics asks this at every step
            enabled = (self._combined(a, b) is not None, self._combined(b, a) is not None)
            self._allowed[a, b] = all(enabled) if self.semantics.gate == "mutual" else any(enabled)
        return self._allowed[a, b]

    def join(self, a: Structure, i: int, b: Structure, j: int, placement: Placement) -> Structure | None:
        """Put b into a's lattice and bond a's cube i with b's cube j, which must come to lie side by side.

        The joined structure, a's cubes first and then b's, letters rewritten and settled. None where the rules
        refuse the bond or cubes would overlap. All cubes that touch are bonded, but only the
        two that dock run a combination rule.
        """
        placed = b.moved(placement)
        face_a = a.face_towards(i, placed.positions[j])
        face_b = placed.face_towards(j, a.positions[i])
        if not a.places.keys().isdisjoint(placed.places):
            return None
        view_a, view_b = self.view(a, i, face_a), self.view(placed, j, face_b)
        if view_a is None or view_b is None or not self.allows(view_a, view_b):
            return None
        new_a = self._combined(view_a, view_b) or view_a.letter
        if self.semantics.update == "sequential":
            view_a = view_a._replace(letter=new_a)
        new_b = self._combined(view_b, view_a) or view_b.letter
        letters = [*a.letters, *placed.letters]
        letters[i], letters[len(a) + j] = new_a, new_b
        joined = Structure((*a.positions, *placed.positions), (*a.rotations, *placed.rotations), tuple(letters))
        return self.settle(joined)

    def break_bond(self, structure: Structure, i: int, j: int) -> tuple[tuple[tuple[int, ...], Structure], ...]:
        """Break the bond of cubes i and j: ((members, fragment) of i's side, (members, fragment) of j's side).

        members : the fragment's cubes as indices in `structure`, rising; positions stay where they were
        A bond within a loop cannot break alone: ValueError.
        """
        sides = structure.sides(i, j)
        if sides is None:
            raise ValueError(
                f"the bond of cubes {i} and {j} lies in a loop of {structure}; only bonds that hold two parts "
                "together can break one at a time"
            )
        letters = list(structure.letters)
        new_i = self._after_loss(structure, i, j, letters[j])
        partner = new_i if self.semantics.update == "sequential" else letters[i]
        letters[j] = self._after_loss(structure, j, i, partner)
        letters[i] = new_i
        rewritten = structure.with_letters(letters)
        return tuple((members, self.settle(rewritten.part(members))) for members in sides)

    def settle(self, structure: Structure) -> Structure:
        """Apply the internal rules, all cubes at once, again and again until nothing changes.

        LivelockError: the letters come round to what they were before.
        """
        letters = structure.letters
        seen = set()
        while letters not in seen:
            seen.add(letters)
            following = tuple(
                self._answer("internal", letter=letter, neighbours=_sorted(letters, structure.neighbours(cube)))
                or letter
                for cube, letter in enumerate(letters)
            )
            if following == letters:
                return structure if letters is structure.letters else structure.with_letters(letters)
            letters = following
        raise LivelockError(
            f"book {self.name!r}: the internal rules never come to rest on {structure}; "
            f"letters {' '.join(letters)} return again and again"
        )

    def _combined(self, own: View, partner: View) -> str | None:
        """The letter of a cube after it bonds, or None where no rule is enabled."""
        if any(end.letter == own.letter and end.neighbour in own.neighbours for end in self.semantics.finished):
            return None
        return self._answer("combine", **own._asdict(), partner=partner.letter, partner_face=partner.face)

    def _after_loss(self, structure: Structure, cube: int, gone: int, lost: str) -> str:
        """The letter of a cube that loses the bond to cube `gone`, whose letter it reads as `lost`."""
        own = structure.letters[cube]
        around = _sorted(structure.letters, (n for n in structure.neighbours(cube) if n != gone))
        return self._answer("dissociate", letter=own, neighbours=around, lost=lost) or own

    def _answer(self, kind: Literal["combine", "dissociate", "internal"], **reading: Any) -> str | None:
        """The letter that the rules of a kind give to a cube with this reading; None where no rule fits."""
        key = (kind, *reading.values())
        if key not in self._answers:
            self._answers[key] = first_that_fits(self._tried[kind], reading)
        return self._answers[key]

    def _check_names(self) -> None:
        """Every letter, face and rule name is known, and known once."""
        scheme = scheme_of(self.scheme)
        if not self.letters or len(set(self.letters)) != len(self.letters) or not all(self.letters):
            raise ValueError(f"letters are {list(self.letters)}; expected at least one, each named once")
        self._known("initial", [self.initial])
        for end in self.semantics.finished:
            self._known("semantics.finished", [end.letter, end.neighbour])
        if self.target is not None:
            self._known("target", self.target.letters)
        rules = (*self.combine, *self.dissociate, *self.internal)
        names = Counter(rule.rule for rule in rules)
        for rule in rules:
            if names[rule.rule] > 1:
                raise ValueError(f"two rules are called {rule.rule!r}; give every rule a name of its own")
            self._known(f"rule {rule.rule}, becomes", [rule.becomes])
            for name, admitted in rule.conditions.items():
                if not name.endswith("face"):
                    self._known(f"rule {rule.rule}, {name}", admitted or ())
                elif unknown := set(admitted or ()) - set(scheme.names):
                    raise ValueError(
                        f"rule {rule.rule}, {name}: unknown face {min(unknown)!r}; the faces of scheme "
                        f"{scheme.name!r} are {', '.join(scheme.names)}"
                    )

    def _known(self, place: str, letters: Iterable[str]) -> None:
        for letter in letters:
            if letter not in self.letters:
                raise ValueError(
                    f"{place}: unknown letter {letter!r}; the book's letters are {', '.join(self.letters)}"
                )


def _sorted(letters: Sequence[str], cubes: Iterable[int]) -> tuple[str, ...]:
    """The letters of some cubes as a multiset."""
    return tuple(sorted(letters[cube] for cube in cubes))
