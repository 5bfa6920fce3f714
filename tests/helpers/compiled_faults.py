"""Compiled books with faults: targets with loops, corners and screws, whose cubes sense twists and what they touch."""

from dataclasses import replace
from functools import cache

import numpy as np

from kinetics.assembly import Semantics
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.rules.conditions import EXACT
from tests.helpers.mutated_books import FAULTS as RULES_CHANGED
from tests.helpers.mutated_books import _change, _some
from tests.helpers.polycubes import SHAPES

NAMES = ("L3", "L4", "T4", "S4", "O4", "corner", "right")


@cache
def compiled(name):
    return compile_book(Target(name, SHAPES[name]), time_limit=float("inf")).book


def faulty(seed):
    """A compiled book with one to three faults; None where its rules contradict each other or its names."""
    rng = np.random.default_rng([seed, 77])
    book = compiled(NAMES[rng.integers(len(NAMES))])
    fields = {kind: list(rules) for kind, rules in book.rules.items()}
    letters = [*book.letters, "x"]
    for _ in range(rng.integers(1, 4)):
        FAULTS[rng.integers(len(FAULTS))](fields, letters, rng)
    semantics = Semantics(
        gate="any" if rng.random() < 0.1 else "mutual",
        conflict="first",
        update=("synchronous", "sequential")[rng.integers(2)],
        bonds="hold" if rng.random() < 0.2 else "break",
    )
    seed_letter = str(rng.choice(letters)) if rng.random() < 0.15 else None
    rules = {kind: tuple(changed) for kind, changed in fields.items()}
    try:
        return replace(
            book, name=f"faulty {seed}", letters=tuple(letters), semantics=semantics, seed_letter=seed_letter, **rules
        )
    except ValueError:
        return None


def confuse(fields, letters, rng):
    """One letter stands for another one as well, in all rules."""
    one, other = map(str, rng.choice(letters, 2, replace=False))

    def renamed(name, value):
        new = [other if letter == one else letter for letter in value]
        return tuple(sorted(new) if name in EXACT else new)

    for rules in fields.values():
        for n, rule in enumerate(rules):
            read = {
                name: getattr(rule, name) for name in type(rule).__struct_fields__ if name not in ("rule", "becomes")
            }
            changes = {name: renamed(name, value) for name, value in read.items() if isinstance(value, tuple)}
            changes["becomes"] = other if rule.becomes == one else rule.becomes
            rules[n] = rule.replace(**changes)


def copy_to_another_letter(fields, letters, rng):
    rules = _some(fields, rng)
    if rules:
        changes = {"letter": (str(rng.choice(letters)),), "becomes": str(rng.choice(letters))}
        copied = rules[rng.integers(len(rules))].replace(**changes)
        rules.insert(int(rng.integers(len(rules) + 1)), copied)


def forget_to_look(fields, letters, rng):
    """A rule no longer asks about something."""
    _change(fields, rng, {str(rng.choice(["touched", "roll", "across", "neighbours", "face", "partner_face"])): None})


FAULTS = (*RULES_CHANGED, confuse, copy_to_another_letter, forget_to_look, forget_to_look)
