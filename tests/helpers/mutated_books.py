"""Rule books with faults: right ones with rules dropped or changed, and a trap."""

from dataclasses import replace

import numpy as np

from kinetics.assembly import RuleBook, Semantics, Structure
from kinetics.assembly.rules.conditions import Combination, Dissociation
from tests.helpers.tree_books import pairs_book, tree_book

BASES = ("line3", "line4", "line4_pairs", "t5_bar", "tree", "tree", "seeded", "pairs")


def line3():
    """Lines of three by the rules that lines of four have for them."""
    book = RuleBook.load("line4")
    line = Structure(((0, 0, 0), (0, 0, 1), (0, 0, 2)), (0, 0, 0), ("b", "c", "b"))
    kept = {"P1", "P3", "P1'", "P3'"}
    rules = {kind: tuple(rule for rule in group if rule.rule in kept) for kind, group in book.rules.items()}
    return replace(book, letters=("a", "b", "c"), target=line, **rules)


def mutated(seed):
    """A book with one to three faults drawn at random; None where its rules contradict each other or its names."""
    rng = np.random.default_rng(seed)
    book = _base(BASES[rng.integers(len(BASES))], rng)
    held = Semantics(
        gate=book.semantics.gate,
        conflict="first",
        update=("synchronous", "sequential")[rng.integers(2)],
        bonds="hold" if rng.random() < 0.15 else "break",
    )
    fields = {"combine": list(book.combine), "dissociate": list(book.dissociate), "internal": list(book.internal)}
    letters = [*book.letters, "x"]
    for _ in range(rng.integers(1, 3)):
        FAULTS[rng.integers(len(FAULTS))](fields, letters, rng)
    try:
        return replace(
            book,
            name=f"mutant {seed}",
            letters=tuple(letters),
            semantics=held,
            **{kind: tuple(rules) for kind, rules in fields.items()},
        )
    except ValueError:
        return None


def _base(name, rng):
    if name == "line3":
        return line3()
    if name == "pairs":
        return pairs_book(int(rng.integers(1 << 30)))
    if name in ("tree", "seeded"):
        return tree_book(int(rng.integers(1 << 30)), int(rng.integers(3, 5)), seeded=name == "seeded")
    return RuleBook.load(name)


def drop(fields, letters, rng):
    rules = _some(fields, rng)
    if rules:
        rules.pop(rng.integers(len(rules)))


def become_another(fields, letters, rng):
    _change(fields, rng, {"becomes": str(rng.choice(letters))})


def read_another(fields, letters, rng):
    name = str(rng.choice(["letter", "neighbours", "partner", "lost"]))
    value = None if rng.random() < 0.3 else (str(rng.choice(letters)),)
    _change(fields, rng, {name: value})


def lose_into_a_trap(fields, letters, rng):
    """A cube that loses a bond becomes x, which pairs with a free cube alone and lets it go again, for ever."""
    free = letters[0]
    fields["dissociate"].insert(0, Dissociation(rule="fall", letter=str(rng.choice(letters[1:-1])), becomes="x"))
    fields["dissociate"].insert(0, Dissociation(rule="let go", letter="x", becomes="x"))
    fields["dissociate"].insert(0, Dissociation(rule="go", letter=free, lost="x", becomes=free))
    fields["combine"] += [
        Combination(rule="catch", letter="x", partner=free, face="f1", partner_face="f1", neighbours=[], becomes="x"),
        Combination(rule="caught", letter=free, partner="x", face="f1", partner_face="f1", neighbours=[], becomes=free),
    ]


FAULTS = (drop, become_another, read_another, lose_into_a_trap)


def _some(fields, rng):
    return fields[("combine", "dissociate", "internal")[rng.integers(3)]]


def _change(fields, rng, changes):
    rules = _some(fields, rng)
    if not rules:
        return
    place = int(rng.integers(len(rules)))
    known = {name: value for name, value in changes.items() if name in type(rules[place]).__struct_fields__}
    rules[place] = rules[place].replace(**known)
