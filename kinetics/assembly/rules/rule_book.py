"""Rule books: when two faces may bond, and how the cubes' letters change as bonds form and break.

A book is asked by the mechanics and by the derivation of the network alike, through the same four
functions: `view`, `allows`, `join` and `break_bond`. The rules are those of section IV of the paper, with
the choices its tables leave open made explicit in `Semantics`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from msgspec.structs import asdict

from kinetics.assembly.faces import roll, scheme_of
from kinetics.assembly.rules.conditions import (
    BookFile,
    Combination,
    Dissociation,
    Internal,
    Rule,
    Semantics,
    Senses,
    first_that_fits,
    in_order,
)
from kinetics.assembly.rules.names import check_names
from kinetics.assembly.rules.words import rule_words, semantics_words
from kinetics.assembly.structure import Placement, Structure
from kinetics.support.config import find, read_toml
from kinetics.support.settings import validated
from kinetics.support.shown import on_axes

if TYPE_CHECKING:
    from kinetics.assembly.drawing.drawing import Drawing

BOOKS = Path(__file__).parents[1] / "books"


class LivelockError(ValueError):
    """Raised where the internal rules of a book never come to rest."""


class View(NamedTuple):
    """All that a cube may read at an open face, within the senses of the book.

    letter, face, neighbours : its own letter, the face's type, the letters of the cubes bonded to it
    across : the letter of the cube at the opposite face; "" if there is none
    roll, touched : the twist, and the letters of all cubes touched; None while nothing docks
    """

    letter: str
    face: str
    neighbours: tuple[str, ...]
    across: str = ""
    roll: str | None = None
    touched: tuple[str, ...] | None = None


@dataclass(frozen=True)
class RuleBook:
    """Rules for cubes that all run the same state machine.

    letters : the states that a cube may be in
    initial : the letter of a free cube
    senses : what a cube can sense
    target : the finished structure, if the book names one
    seed_letter : the letter of the cube from which the assembly grows, if it needs one
    """

    name: str
    letters: tuple[str, ...]
    initial: str
    senses: Senses
    target: Structure | None = None
    seed_letter: str | None = None
    semantics: Semantics = field(default_factory=Semantics)
    combine: tuple[Combination, ...] = ()
    dissociate: tuple[Dissociation, ...] = ()
    internal: tuple[Internal, ...] = ()
    _tried: dict[str, tuple[Rule, ...]] = field(default_factory=dict, init=False, repr=False, compare=False)
    _allowed: dict[tuple[View, View], bool] = field(default_factory=dict, init=False, repr=False, compare=False)
    _answers: dict[Any, Rule | None] = field(default_factory=dict, init=False, repr=False, compare=False)
    fired: set[str] = field(default_factory=set, init=False, repr=False, compare=False)  # rules applied so far
    _moving: set[str] = field(default_factory=set, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_names(self)
        for kind, rules in self.rules.items():
            self._tried[kind] = in_order(rules, self.semantics.conflict)
        self._moving.update(*(rule.letter or self.letters for rule in self.internal))

    @classmethod
    def load(cls, name_or_path: str | Path) -> RuleBook:
        """Load a shipped book by its name (`line4`), or a TOML file of your own."""
        path = find(name_or_path, BOOKS, "rule book")
        content = validated(BookFile, read_toml(path), path)
        fields = {name: getattr(content, name) for name in BookFile.__struct_fields__}
        fields["seed_letter"] = fields.pop("seed")
        try:
            if content.target is not None:
                fields["target"] = content.target.structure()
            return cls(name=path.stem, **fields)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the content; the file's name and comments do not count."""
        target = self.target and (self.target.positions, self.target.rotations, self.target.letters)
        # What books came to declare later counts only if it is used, so that older books keep their names.
        held = {"bonds"} if self.semantics.bonds == "break" else set()
        content: list[Any] = [self.letters, self.initial, self.scheme, target, self.semantics.as_dict(without=held)]
        senses = {name: value for name, value in asdict(self.senses).items() if name != "faces" and value}
        content += [later for later in (senses, self.seed_letter) if later]
        rules = [[_content(rule) for rule in group] for group in self.rules.values()]
        return hashlib.sha256(json.dumps([content, rules], sort_keys=True).encode()).hexdigest()

    @property
    def rules(self) -> dict[str, tuple[Rule, ...]]:
        """Kind -> its rules: `combine`, `dissociate`, `internal`."""
        return {"combine": self.combine, "dissociate": self.dissociate, "internal": self.internal}

    @property
    def all_rules(self) -> tuple[Rule, ...]:
        """The rules of every kind."""
        return (*self.combine, *self.dissociate, *self.internal)

    @property
    def scheme(self) -> str:
        """The name of the face scheme."""
        return self.senses.faces

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Draw the rules as a state diagram; returns `ax`."""
        return self.drawing().onto(ax)

    def drawing(self) -> Drawing:
        """The rules as a state diagram."""
        from kinetics.assembly.drawing.diagrams import DrawnRule, state_diagram

        rules = [
            DrawnRule(kind, rule.rule, rule.letter or self._others(rule.becomes), rule.becomes, rule_words(rule))
            for kind, group in self.rules.items()
            for rule in group
        ]
        notes = semantics_words(self.semantics)
        notes += ["double ring: in the finished structure"] if self.target is not None else []
        final = () if self.target is None else self.target.letters
        return state_diagram(self.letters, rules, self.initial, self.seed_letter, final, notes)

    def _others(self, letter: str) -> tuple[str, ...]:
        return tuple(other for other in self.letters if other != letter)

    def monomer(self) -> Structure:
        """A free cube."""
        return self.settle(Structure(((0, 0, 0),), (0,), (self.initial,)))

    def seed(self) -> Structure | None:
        """The cube from which the assembly grows; None if the book needs none."""
        if self.seed_letter is None:
            return None
        return self.settle(Structure(((0, 0, 0),), (0,), (self.seed_letter,)))

    def view(
        self, structure: Structure, cube: int, face: int, other: Structure | None = None, partner: int = 0
    ) -> View | None:
        """What a cube reads at its own face (0..5); None if another cube covers it.

        other, partner : a structure that docks, already placed in this one's lattice, and its cube in front of the
            face; without them, what a cube can read only while docking is left open (None)
        """
        if structure.cube_at(structure.faced(cube, face)) is not None:
            return None
        senses = self.senses
        around = _sorted(structure.letters, structure.neighbours(cube))
        across, twist, touched = "", None, None
        if senses.across:
            behind = structure.cube_at(structure.faced(cube, face ^ 1))
            across = "" if behind is None else structure.letters[behind]
        if other is not None:
            if senses.roll:
                twist = roll(self.scheme, structure.rotations[cube], face, other.rotations[partner])
            if senses.touched:
                touched = _sorted(other.letters, other.touching(structure.positions[cube]))
        return View(structure.letters[cube], scheme_of(self.scheme).types[face], around, across, twist, touched)

    def allows(self, a: View | None, b: View | None) -> bool:
        """Whether two faces with these views may bond.

        For faces that are not docking yet: whether they may bond in some placement; `join` then decides.
        """
        if a is None or b is None:
            return False
        if (a, b) not in self._allowed:  # the mechanics asks this at every step
            enabled = (self._combined(a, b) is not None, self._combined(b, a) is not None)
            self._allowed[a, b] = all(enabled) if self.semantics.gate == "mutual" else any(enabled)
        return self._allowed[a, b]

    def join(
        self, a: Structure, i: int, b: Structure, j: int, placement: Placement, settle: bool = True
    ) -> Structure | None:
        """Place b in a's lattice and bond a's cube i with b's cube j, which must then lie side by side.

        Returns the joined structure, a's cubes first and then b's, with its letters rewritten and, with `settle`, the
        internal rules applied; None if the rules refuse the bond or cubes would overlap. All cubes that touch are
        bonded, but only the two that dock run a combination rule.
        """
        placed = b.moved(placement)
        face_a = a.face_towards(i, placed.positions[j])
        face_b = placed.face_towards(j, a.positions[i])
        if not a.places.keys().isdisjoint(placed.places):
            return None
        view_a, view_b = self.view(a, i, face_a, placed, j), self.view(placed, j, face_b, a, i)
        if view_a is None or view_b is None or not self.allows(view_a, view_b):
            return None
        new_a = self._rewritten(view_a.letter, self._combined(view_a, view_b))
        if self.semantics.update == "sequential":
            view_a = view_a._replace(letter=new_a)
        new_b = self._rewritten(view_b.letter, self._combined(view_b, view_a))
        joined = a.joined(placed)
        letters = list(joined.letters)
        letters[i], letters[len(a) + j] = new_a, new_b
        rewritten = joined.with_letters(letters)
        return self.settle(rewritten) if settle else rewritten

    def break_bond(
        self, structure: Structure, i: int, j: int, settle: bool = True
    ) -> tuple[tuple[tuple[int, ...], Structure], ...]:
        """Break the bond of cubes i and j: ((members, fragment) of i's side, (members, fragment) of j's side).

        members : the fragment's cubes as indices in `structure`, rising; positions stay where they were
        A bond within a loop cannot break alone: ValueError.
        """
        if self.semantics.bonds == "hold":
            raise ValueError(f"the bonds of book {self.name!r} hold for ever (semantics.bonds); nothing may break them")
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
        parts = ((members, rewritten.part(members)) for members in sides)
        return tuple((members, self.settle(part) if settle else part) for members, part in parts)

    def settle(self, structure: Structure) -> Structure:
        """Apply the internal rules to all cubes at once, until nothing changes.

        LivelockError: the letters return to what they were before.
        """
        letters = structure.letters
        seen = set()
        while letters not in seen:
            seen.add(letters)
            following = self._followed(structure, letters)
            if following == letters:
                return structure if letters is structure.letters else structure.with_letters(letters)
            letters = following
        raise LivelockError(
            f"book {self.name!r}: the internal rules never come to rest on {structure}; "
            f"letters {' '.join(letters)} return again and again"
        )

    def steps(self, structure: Structure) -> Iterator[Structure]:
        """The structures that an internal rule at a single cube can lead to."""
        letters = structure.letters
        for cube in range(len(letters)):
            letter = self._followed_at(structure, letters, cube)
            if letter != letters[cube]:
                yield structure.with_letters((*letters[:cube], letter, *letters[cube + 1 :]))

    def _followed(self, structure: Structure, letters: tuple[str, ...]) -> tuple[str, ...]:
        """The letters after one round of the internal rules."""
        if self._moving.isdisjoint(letters):
            return letters
        return tuple(self._followed_at(structure, letters, cube) for cube in range(len(letters)))

    def _followed_at(self, structure: Structure, letters: tuple[str, ...], cube: int) -> str:
        letter = letters[cube]
        if letter not in self._moving:
            return letter
        around = _sorted(letters, structure.neighbours(cube))
        return self._rewritten(letter, self._answer("internal", letter=letter, neighbours=around))

    def _rewritten(self, letter: str, rule: Rule | None) -> str:
        """What a rule, if any, makes of a letter."""
        if rule is None:
            return letter
        self.fired.add(rule.rule)
        return rule.becomes

    def _combined(self, own: View, partner: View) -> Rule | None:
        """The rule that a cube follows as it bonds, or None if no rule is enabled."""
        if any(end.letter == own.letter and end.neighbour in own.neighbours for end in self.semantics.finished):
            return None
        return self._answer("combine", **own._asdict(), partner=partner.letter, partner_face=partner.face)

    def _after_loss(self, structure: Structure, cube: int, gone: int, lost: str) -> str:
        """The letter of a cube that loses the bond to cube `gone`, whose letter it reads as `lost`."""
        own = structure.letters[cube]
        around = _sorted(structure.letters, (n for n in structure.neighbours(cube) if n != gone))
        return self._rewritten(own, self._answer("dissociate", letter=own, neighbours=around, lost=lost))

    def _answer(self, kind: Literal["combine", "dissociate", "internal"], **reading: Any) -> Rule | None:
        """The rule of a kind that fits a cube with this reading; None if no rule fits."""
        key = (kind, *reading.values())
        if key not in self._answers:
            self._answers[key] = first_that_fits(self._tried[kind], reading)
        return self._answers[key]


def _content(rule: Rule) -> dict[str, Any]:
    """A rule as it enters the fingerprint."""
    later = ("has", "roll", "across", "touched")
    return {name: value for name, value in rule.as_dict().items() if value is not None or name not in later}


def _sorted(letters: Sequence[str], cubes: Iterable[int]) -> tuple[str, ...]:
    """The letters of some cubes as a multiset."""
    return tuple(sorted(letters[cube] for cube in cubes))
