"""The search for any book of so many letters: it agrees with the compiler, and what it finds is a book."""

from collections import Counter

import pytest
from polycubes import SHAPES, grown_shapes

from kinetics.assembly import RuleBook, check, derive
from kinetics.assembly.checking.book_search import BookSearch, StepsError
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal, Semantics

LETTERS = {"I2": 1, "I3": 2, "L3": 2, "I4": 2, "L4": 2, "T4": 2, "S4": 2, "O4": 3, "corner": 2, "right": 2, "left": 2}


@pytest.fixture(scope="module")
def compiled():
    return {name: compile_book(Target(name, cubes), time_limit=float("inf")) for name, cubes in SHAPES.items()}


def searched(made, letters, **options):
    book = made.book
    return BookSearch(book.target, book.senses, book.semantics.bonds == "break", letters, **options).search()


def test_these_are_all_shapes():
    ours = {Target(name, cubes).structure("one").canonical("one") for name, cubes in SHAPES.items()}
    assert ours == set().union(*(grown_shapes(size) for size in (2, 3, 4)))
    assert len(ours) == len(SHAPES) == 11


@pytest.mark.parametrize("name", SHAPES)
def test_the_compiler_takes_the_fewest_letters_of_its_kind_of_books(compiled, name):
    made = compiled[name]
    assert (made.letters, made.minimal) == (LETTERS[name], True)
    assert check(made.book).is_correct
    for fewer in range(1, made.letters):
        assert searched(made, fewer).rules is None


@pytest.mark.parametrize("name", [name for name in SHAPES if name not in {"O4", "right", "left"}])
def test_other_kinds_of_books_have_no_fewer_letters(compiled, name):
    """Nor where one shape comes with several letterings, or a join happens in some of its ways alone.

    Left out, as it takes more than a million answers: the plate with two letters. The screws take minutes.
    """
    for fewer in range(1, LETTERS[name]):
        assert searched(compiled[name], fewer, one_lettering=False).rules is None


@pytest.mark.parametrize("name", ["I2", "I3", "L3", "I4"])
def test_what_it_finds_is_a_book_of_its_kind(compiled, name):
    """The control: with as many letters as the compiler takes there is a book, and the rules do what they should."""
    made = compiled[name]
    book = book_of(searched(made, made.letters), made.book)
    derived = derive(book)
    shapes = Counter(s.with_letters(["#"] * len(s)).canonical(book.scheme) for s in derived.structures.values())
    assert set(shapes.values()) == {1}
    assert made.book.target.with_letters(["#"] * len(made.book.target)).canonical(book.scheme) in shapes
    assert max(map(len, shapes)) == len(made.book.target)


def book_of(found, like):
    """The rules that were found as a rule book."""
    combine, dissociate, internal = [], [], []
    senses = like.senses
    for number, (reading, becomes) in enumerate(found.rules.items()):
        kind, own, *rest = reading
        rule = {"rule": f"{number}", "letter": (own,), "becomes": becomes}
        if kind == "break":
            dissociate.append(Dissociation(**rule, neighbours=rest[0], lost=(rest[1],)))
        elif kind == "follow":
            internal.append(Internal(**rule, neighbours=rest[0]))
        elif becomes:
            face, near, partner, theirs, across, twist, touched = rest
            seen = {
                **({"across": (across,)} if senses.across else {}),
                **({"roll": (twist,)} if senses.roll else {}),
                **({"touched": touched} if senses.touched else {}),
            }
            combine.append(
                Combination(**rule, face=(face,), neighbours=near, partner=(partner,), partner_face=(theirs,), **seen)
            )
    rules = tuple(combine), tuple(dissociate), tuple(rule for rule in internal if rule.becomes != rule.letter[0])
    names = tuple("abcd"[: found.letters])
    return RuleBook("found", names, "a", like.senses, None, None, Semantics(), *rules)


def test_more_steps_than_allowed_decide_nothing(compiled):
    with pytest.raises(StepsError):
        searched(compiled["O4"], 2, most_steps=100)


def test_joins_asked_for_are_kept(compiled):
    """A line of four by any joins takes two letters; by all four of them, three."""
    made = compile_book(Target.load("line4"), joins=["1+1", "1+2", "1+3", "2+2"], time_limit=float("inf"))
    book = made.book
    derived = derive(book)
    bare = [s.with_letters(["#"] * len(s)).canonical("two") for s in derived.structures.values()]
    joins = frozenset(
        (*sorted((bare[before[0]], bare[before[1]]), key=repr), bare[after[0]])
        for before, after in derived.events
        if len(before) == 2
    )
    assert len(joins) == 4
    assert searched(made, 2, joins=joins).rules is None
    assert searched(made, 2).rules is not None
