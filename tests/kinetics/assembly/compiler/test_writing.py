"""Books written as TOML read back as the same books."""

from dataclasses import replace

import pytest

from kinetics.assembly import RuleBook, Semantics, Senses, Structure
from kinetics.assembly.rules.conditions import Combination, Dissociation, Finished, Internal
from kinetics.assembly.rules.rule_book import BOOKS
from kinetics.assembly.rules.writing import WIDTH, written

SHIPPED = sorted(path.stem for path in BOOKS.glob("*.toml"))


def again(book, folder, note=""):
    path = folder / f"{book.name}.toml"
    path.write_text(written(book, note), encoding="utf-8")
    return RuleBook.load(path)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_books_come_back(name, tmp_path):
    book = RuleBook.load(name)
    back = again(book, tmp_path, note="Grown from a seed.\n\nSecond paragraph, " + "long " * 50)
    assert back == book
    assert back.fingerprint == book.fingerprint
    assert max(map(len, written(book).splitlines())) <= WIDTH + 2


def test_one_changed_rule_is_another_book(tmp_path):
    """The control: the fingerprint would see a condition that is lost."""
    book = RuleBook.load("line4")
    first = book.combine[0].replace(neighbours=None)
    assert again(replace(book, combine=(first, *book.combine[1:])), tmp_path).fingerprint != book.fingerprint


def test_everything_a_book_may_hold(tmp_path):
    """Odd letters, conditions of several kinds, empty multisets, cubes that stand askew."""
    letters = ("a", 'quo"te', "back\\slash", "ü\n#")
    book = RuleBook(
        name="odd",
        letters=letters,
        initial="a",
        seed_letter=letters[1],
        senses=Senses(faces="six", roll=True, across=True, touched=True),
        semantics=Semantics(gate="any", bonds="break", finished=(Finished(letter="a", neighbour=letters[3]),)),
        target=Structure(((0, 0, 0), (0, 0, 1), (0, 1, 1)), (0, 5, 17), letters[:3]),
        combine=(
            Combination(
                rule="all", letter=("a", letters[3]), face="f1", partner=letters[1], partner_face=("f2", "f3"),
                roll=(0, 270), across=("", letters[2]), touched=(letters[1],), neighbours=(), becomes=letters[2],
            ),
        ),
        dissociate=(Dissociation(rule="one", lost="a", has=("a",), becomes="a"),),
        internal=(Internal(rule="none", letter=letters[1], neighbours=("a",) * 30, becomes="a"),),
    )  # fmt: skip
    back = again(book, tmp_path)
    assert back == book
    assert back.fingerprint == book.fingerprint


def test_every_turn_of_a_cube_comes_back(tmp_path):
    book = RuleBook.load("line4")
    for rotation in range(24):
        turned = replace(book, target=Structure(((0, 0, 0), (0, 0, 1)), (rotation, 0), ("b", "b")))
        assert again(turned, tmp_path).fingerprint == turned.fingerprint


def test_a_book_shows_only_what_is_unusual():
    text = written(RuleBook.load("line4"))
    assert "[semantics]" not in text  # all as usual
    assert 'letter = "a"\n' in text
    assert "neighbours = []" in text
