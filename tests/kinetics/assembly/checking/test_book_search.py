"""The search for any book of so many letters: it agrees with the compiler, and what it finds is a book."""

from collections import Counter
from functools import cache
from pathlib import Path

import pytest
from book_oracle import Oracle
from polycubes import SHAPES, grown_shapes

from kinetics.assembly import RuleBook, check, derive
from kinetics.assembly.checking.book_search import BookSearch, Pieces
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal, Semantics, Senses

LETTERS = {"I2": 1, "I3": 2, "L3": 2, "I4": 2, "L4": 2, "T4": 2, "S4": 2, "O4": 3, "corner": 2, "right": 2, "left": 2}


LONG = pytest.mark.validate


@cache
def compiled(name):
    return compile_book(Target(name, SHAPES[name]), time_limit=float("inf"))


def searched(made, letters, joins=None, most_steps=100_000):
    """Whether there is a book, and its rules."""
    book = made.book
    pieces = Pieces(book.target, book.senses)
    search = BookSearch(pieces, book.semantics.bonds == "break", letters, joins and joins(pieces))
    return search.finds_one(most_steps), search.rules


def test_these_are_all_shapes():
    ours = {Target(name, cubes).structure("one").canonical("one") for name, cubes in SHAPES.items()}
    assert ours == set().union(*(grown_shapes(size) for size in (2, 3, 4)))
    assert len(ours) == len(SHAPES) == 11


@pytest.mark.parametrize("name", [pytest.param(name, marks=LONG if name == "left" else ()) for name in SHAPES])
def test_the_compiler_takes_the_fewest_letters_of_its_kind_of_books(name):
    made = compiled(name)
    assert (made.letters, made.minimal) == (LETTERS[name], True)
    for fewer in range(1, made.letters):
        assert searched(made, fewer)[0] is False


@pytest.mark.parametrize("name", [pytest.param(name, marks=LONG if name == "left" else ()) for name in SHAPES])
def test_no_book_with_one_letter_does_of_any_kind(name):
    """Nor where a join happens in some of its ways alone; by the solver. A pair of cubes takes one letter."""
    book = compiled(name).book
    assert Oracle(book.target, book.senses, book.semantics.bonds == "break", 1).finds_one() is (LETTERS[name] == 1)


def test_the_plate_has_a_book_of_two_letters_of_another_kind():
    """Three are the fewest of the compiler's kind: here, shapes come with several letterings."""
    like, book = compiled("O4").book, RuleBook.load(Path(__file__).with_name("plate_of_two_letters.toml"))
    assert (len(book.letters), len(like.letters)) == (2, 3)
    assert (book.senses, book.semantics) == (like.senses, like.semantics)
    assert bare(book.target, book.scheme) == bare(like.target, book.scheme)
    assert check(book).is_correct
    shapes = Counter(bare(s, book.scheme) for s in derive(book).structures.values())
    assert max(shapes.values()) > 1
    oracle = Oracle(like.target, like.senses, like.semantics.bonds == "break", 2)
    assert oracle.finds_one() is True


def bare(structure, scheme):
    return structure.with_letters(["#"] * len(structure)).canonical(scheme)


@pytest.mark.parametrize("name", ["I2", "I3", "L3", "I4"])
def test_what_it_finds_is_a_book_of_its_kind(name):
    """The control: with as many letters as the compiler takes there is a book, and the rules do what they should."""
    made = compiled(name)
    found, rules = searched(made, made.letters)
    assert found
    book = book_of(rules, made.book, made.book.letters)
    derived = derive(book)
    shapes = Counter(bare(s, book.scheme) for s in derived.structures.values())
    assert set(shapes.values()) == {1}
    assert bare(made.book.target, book.scheme) in shapes
    assert max(map(len, shapes)) == len(made.book.target)


def book_of(rules, like, names):
    """The rules that were found as a rule book."""
    combine, dissociate, internal = [], [], []
    senses = like.senses
    for number, (((kind, *seen), (own,), near, *rest), (becomes, _)) in enumerate(rules.items()):
        rule = {"rule": f"{number}", "letter": (own,), "neighbours": near, "becomes": becomes}
        if kind == "break":
            dissociate.append(Dissociation(**rule, lost=rest[0]))
        elif kind == "follow" and becomes != own:
            internal.append(Internal(**rule))
        elif kind == "join" and becomes:
            (face, partner_face, twist), (partner, across, touched) = seen, rest
            more = {
                **({"across": across or ("",)} if senses.across else {}),
                **({"roll": (twist,)} if senses.roll else {}),
                **({"touched": touched} if senses.touched else {}),
            }
            combine.append(Combination(**rule, face=(face,), partner=partner, partner_face=(partner_face,), **more))
    rules = tuple(combine), tuple(dissociate), tuple(internal)
    return RuleBook("found", names, "a", senses, None, None, Semantics(bonds=like.semantics.bonds), *rules)


def test_more_steps_than_allowed_decide_nothing():
    assert searched(compiled("O4"), 2, most_steps=100)[0] is None


def test_joins_asked_for_are_kept():
    """A line of four by any joins takes two letters; by all four of them, three."""
    made = compile_book(Target.load("line4"), joins=["1+1", "1+2", "1+3", "2+2"], time_limit=float("inf"))
    assert len(made.joins) == 4
    assert searched(made, 2, lambda pieces: pieces.joins)[0] is False
    assert searched(made, 2)[0] is True


def test_what_leads_to_the_target():
    """A line of four without some of its joins: breaks make threes of it, which fall into what grows again."""
    line = Pieces(Target("I4", SHAPES["I4"]).structure("one"), Senses(faces="one"))
    assert line.joins == {(0, 0, 1), (0, 1, 2), (0, 2, 3), (1, 1, 3)}
    assert line.can_make_target([(0, 1, 2), (0, 2, 3)], True)
    assert line.can_make_target([(0, 1, 2)], False)
    assert not line.can_make_target([(1, 1, 3), (0, 1, 2)], True)
    assert not line.can_make_target([(0, 0, 1)], True)
    assert not line.can_make_target([(1, 1, 3), (0, 2, 3)], False)
