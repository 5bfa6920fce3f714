"""Whether a rule book speaks only of letters, faces and senses that it has."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

from kinetics.assembly.faces import scheme_of

if TYPE_CHECKING:
    from kinetics.assembly.rules.rule_book import RuleBook


def check_names(book: RuleBook) -> None:
    """Every letter, face and rule name is known, and known once."""
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
    rules = (*book.combine, *book.dissociate, *book.internal)
    names = Counter(rule.rule for rule in rules)
    for rule in rules:
        if names[rule.rule] > 1:
            raise ValueError(f"two rules are called {rule.rule!r}; give every rule a name of its own")
        _known(book, f"rule {rule.rule}, becomes", [rule.becomes])
        for name, admitted in rule.conditions.items():
            _check_condition(book, f"rule {rule.rule}, {name}", name, admitted)


def _check_condition(book: RuleBook, place: str, name: str, admitted: tuple[str, ...] | None) -> None:
    """A rule's condition asks for what there is, and for what the book's cubes can sense."""
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


def _known(book: RuleBook, place: str, letters: Iterable[str]) -> None:
    for letter in letters:
        if letter not in book.letters:
            raise ValueError(f"{place}: unknown letter {letter!r}; the book's letters are {', '.join(book.letters)}")
