"""Books of any kind: what the stored table says of them, how it agrees with the compiler, and some of it asked anew."""

from itertools import product

import pytest

from kinetics.assembly import check
from kinetics.assembly.compiler import Target
from kinetics.assembly.compiler.result import sensing
from kinetics.assembly.rules.conditions import Senses
from tests.helpers.answered_books import answered_book
from tests.helpers.book_oracle import FREE, Oracle
from tests.helpers.polycubes import SHAPES
from tests.results.any_books import asked, cases, stored

ROWS = stored()
LESS = {"O4": 2}  # letters of a book of another kind, where the compiler takes more
LONG = pytest.mark.validate
QUICK = ("I2", *(pytest.param(name, marks=LONG) for name in ("I3", "L3", "O4")))


def told(case):
    """What is stored of a case for up to two letters, without the solver's conflicts."""
    key = case.target, sensing(case.senses), case.turn
    return {row.letters: row._replace(conflicts=0) for row in ROWS if row[:3] == key and row.letters < 3}


def anew(case):
    return {letters: asked(case, letters)._replace(conflicts=0) for letters in told(case)}


def test_the_table_has_every_target_and_no_case_of_two_letters_is_open():
    assert {row.target for row in ROWS} == set(SHAPES)
    assert {row.any_book for row in ROWS if row.letters <= 2} == {"none", "found"}


@pytest.mark.parametrize("name", SHAPES)
def test_the_compiler_takes_the_fewest_letters_of_any_kind_of_books(name):
    """But for one plate. With senses that it says are not enough, no book of any kind does, of one letter or two."""
    rows = [row for row in ROWS if row.target == name]
    weaker = [row for row in rows if row.compiler == "infeasible"]
    assert all(row.any_book != "found" for row in weaker)
    assert {row[:3] for row in weaker if row.letters == 1} == {row[:3] for row in weaker if row.letters == 2}
    fewest = {row.letters: row for row in rows if row.compiler.isdigit()}
    (found,) = (row for row in fewest.values() if row.any_book == "found")
    assert found.letters == LESS.get(name, int(found.compiler))
    assert {n for n, row in fewest.items() if row.any_book == "none"} == set(range(1, found.letters))


@pytest.mark.parametrize("name", QUICK)
def test_the_table_is_what_is_found(name):
    """A share of the long test below: the senses that the compiler takes."""
    (case,) = (case for case in cases(name) if case.compiler.isdigit())
    assert anew(case) == told(case)


@pytest.mark.validate
@pytest.mark.parametrize("name", SHAPES)
def test_the_whole_table_is_what_is_found(name):
    """Ten minutes of CPU time for all targets; three letters are left to the command that wrote the table."""
    for case in cases(name):
        assert told(case)
        assert anew(case) == told(case)


@pytest.mark.parametrize("name", QUICK)
def test_books_of_one_letter_are_tried_one_by_one(name):
    """Faces all alike, one letter: a cube reads how many neighbours it has, and bonds or not: 32 books."""
    senses = Senses(faces="one")
    target = Target(name, SHAPES[name]).structure("one").with_letters("a" * len(SHAPES[name]))
    readings = [(("join", "f1", "f1", ""), ("a",), ("a",) * n, ("a",), (), ()) for n in range(5)]
    right = [
        check(answered_book(dict(zip(readings, answers, strict=True)), senses, True, "a", target)).is_correct
        for answers in product(["", "a"], repeat=5)
    ]
    assert Oracle(target, senses, True, 1).finds_one() is any(right)
    assert any(right) is (name == "I2")


BLIND = {
    "what must not bond is not said": ("say_what_must_not_join", lambda *_: None),
    "all comes home": ("home", lambda self, *_: self.atom("answers", FREE, "a")),
}


@pytest.mark.parametrize("blind", BLIND)
def test_the_book_that_a_blind_oracle_finds_is_wrong(blind, monkeypatch):
    """The control: the checker sees it."""
    (case,) = (case for case in cases("I3") if case.compiler.isdigit())
    assert asked(case, 1).any_book == "none"
    monkeypatch.setattr(Oracle, *BLIND[blind])
    with pytest.raises(AssertionError, match="the checker finds fault"):
        asked(case, 1)


def test_too_many_conflicts_decide_nothing():
    (case,) = (case for case in cases("L4") if case.compiler.isdigit())
    assert asked(case, 2, most=1).any_book == "open"
