"""The search for any book of so many letters: it agrees with the compiler, and what it finds is a book."""

from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from kinetics.assembly import RuleBook, check, derive
from kinetics.assembly.checking.book_search import BookSearch, Pieces
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.rules.conditions import Senses
from tests.helpers.answered_books import answered_book
from tests.helpers.polycubes import SHAPES, grown_shapes

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


def test_the_plate_has_a_book_of_two_letters_of_another_kind():
    """Three are the fewest of the compiler's kind: here, shapes come with several letterings."""
    like, book = compiled("O4").book, RuleBook.load(Path(__file__).with_name("plate_of_two_letters.toml"))
    assert (len(book.letters), len(like.letters)) == (2, 3)
    assert (book.senses, book.semantics) == (like.senses, like.semantics)
    assert bare(book.target, book.scheme) == bare(like.target, book.scheme)
    assert check(book).is_correct
    shapes = Counter(bare(s, book.scheme) for s in derive(book).structures.values())
    assert max(shapes.values()) > 1


def bare(structure, scheme):
    return structure.with_letters(["#"] * len(structure)).canonical(scheme)


@pytest.mark.parametrize("name", ["I2", "I3", "L3", "I4"])
def test_what_it_finds_is_a_book_of_its_kind(name):
    """The control: with as many letters as the compiler takes there is a book, and the rules do what they should."""
    made = compiled(name)
    found, rules = searched(made, made.letters)
    assert found
    answers = {reading: answer for reading, (answer, _) in rules.items()}
    book = answered_book(answers, made.book.senses, True, made.book.letters)
    derived = derive(book)
    shapes = Counter(bare(s, book.scheme) for s in derived.structures.values())
    assert set(shapes.values()) == {1}
    assert bare(made.book.target, book.scheme) in shapes
    assert max(map(len, shapes)) == len(made.book.target)


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
