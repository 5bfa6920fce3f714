"""Validation of a rule book's names: letters, faces and senses that it uses must be declared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Protocol

from kinetics.assembly.faces import scheme_of
from kinetics.assembly.rules.conditions import Rule, Semantics, Senses
from kinetics.assembly.structure import Structure


class Declared(Protocol):
    """What a rule book declares; see `RuleBook`."""

    @property
    def letters(self) -> tuple[str, ...]:
        """The states a cube may be in."""

    @property
    def initial(self) -> str:
        """The letter of a free cube."""

    @property
    def seed_letter(self) -> str | None:
        """The letter of the seed, or None without a seed."""

    @property
    def senses(self) -> Senses:
        """What a cube can sense."""

    @property
    def scheme(self) -> str:
        """The name of the face scheme."""

    @property
    def target(self) -> Structure | None:
        """The finished structure, if the book names one."""

    @property
    def semantics(self) -> Semantics:
        """What the paper's tables leave open."""

    @property
    def all_rules(self) -> tuple[Rule, ...]:
        """The rules of every kind."""


def check_names(book: Declared) -> None:
    """ValueError unless every letter, face and rule name is known, and known once."""
    scheme = scheme_of(book.scheme)
    if not book.letters or len(set(book.letters)) != len(book.letters) or not all(book.letters):
        raise ValueError(f"letters are {list(book.letters)}; expected at least one, each named once")
    _known(book, "initial", [book.initial])
    _known(book, "seed", [book.seed_letter] if book.seed_letter is not None else [])
    if book.seed_letter == book.initial:
        raise ValueError(f"seed: {book.initial!r} is the letter of every free cube; give the seed another one")
    for end in book.semantics.finished:
        _known(book, "semantics.finished", [end.letter, end.neighbour])
    if book.target is not None:
        _known(book, "target", book.target.letters)
    if book.senses.roll and not scheme.rolls:
        raise ValueError(f"senses.roll: the faces of scheme {scheme.name!r} show no twist; set it to false")
    names = Counter(rule.rule for rule in book.all_rules)
    for rule in book.all_rules:
        if names[rule.rule] > 1:
            raise ValueError(f"two rules are called {rule.rule!r}; give every rule a name of its own")
        _known(book, f"rule {rule.rule}, becomes", [rule.becomes])
        for name, admitted in rule.conditions.items():
            _check_condition(book, f"rule {rule.rule}, {name}", name, admitted)


def _check_condition(book: Declared, place: str, name: str, admitted: tuple[str, ...] | None) -> None:
    """ValueError if a rule's condition names something unknown, or that the book's cubes cannot sense."""
    scheme = scheme_of(book.scheme)
    if admitted is None:
        return
    if not getattr(book.senses, name, True):
        raise ValueError(f"{place}: the cubes do not sense this; set {name} = true in [senses], or leave it out")
    kinds = {"face": scheme.names, "partner_face": scheme.names, "roll": scheme.rolls}
    if name not in kinds:
        _known(book, place, (letter for letter in admitted if letter or name != "across"))
    elif unknown := set(admitted) - set(kinds[name]):
        kind = name.removeprefix("partner_")
        raise ValueError(
            f"{place}: unknown {kind} {min(unknown)!r}; the {kind}s of scheme {scheme.name!r} are "
            f"{', '.join(kinds[name])}"
        )


def _known(book: Declared, place: str, letters: Iterable[str]) -> None:
    for letter in letters:
        if letter not in book.letters:
            raise ValueError(f"{place}: unknown letter {letter!r}; the book's letters are {', '.join(book.letters)}")
