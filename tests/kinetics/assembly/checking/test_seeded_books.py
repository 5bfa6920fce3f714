"""The checker on books that grow from a seed, each with one fault, against growths by the rules alone."""

from collections import Counter
from dataclasses import replace
from itertools import product

import pytest

from kinetics.assembly import LivelockError, Structure, check
from kinetics.assembly.checking import exploration_index
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.deriving.explore import explore
from kinetics.assembly.deriving.history import random_growth

PLATE = tuple(product(range(-1, 2), range(-1, 2), (0,)))
BAR = tuple((0, 0, z) for z in range(-2, 3))
GROWTHS = 25


def compiled(places):
    asked = Target("plate", places, seed=(0, 0, 0), breaks=False)
    return compile_book(asked, effort=0.05, time_limit=float("inf")).book


def faulty(book):
    """The book with each rule left out, and with each rule making another letter."""
    for kind, rules in book.rules.items():
        for number, rule in enumerate(rules):
            changed = [rule.replace(becomes=letter) for letter in book.letters if letter != rule.becomes]
            for instead in [(), *((other,) for other in changed)]:
                try:
                    yield replace(book, **{kind: (*rules[:number], *instead, *rules[number + 1 :])})
                except ValueError:  # it contradicts another rule
                    continue


def shape(structure):
    return Structure(structure.positions, structure.rotations, ("a",) * len(structure)).canonical("two")


def goes_wrong(book):
    """Whether some of a few growths from the seed does not end with the target's shape."""
    try:
        ends = (random_growth(book, seed, 12)[-1] for seed in range(GROWTHS))
        return any(shape(end) != shape(book.target) for end in ends)  # the first one decides
    except LivelockError:
        return True


def compared(book):
    """What was claimed and seen of each fault; AssertionError where a growth goes wrong that was called right."""
    said = Counter()
    for wrong in faulty(book):
        report = check(wrong, max_cubes=12, max_species=400, slow_waves=False)
        failed = goes_wrong(wrong)
        assert not (failed and report.is_correct), f"{wrong.all_rules}: {report}"
        said[report.is_correct, failed] += 1
    return said


@pytest.mark.parametrize("places", [PLATE, BAR], ids=["plate", "bar"])
def test_no_fault_of_a_seeded_book_is_called_right(places):
    book = compiled(places)
    assert check(book).is_correct
    assert not goes_wrong(book)
    said = compared(book)
    assert said[False, True] >= 5, said


def test_a_checker_that_sees_no_dead_end_is_found_out(monkeypatch):
    """The control."""
    monkeypatch.setattr(exploration_index, "lost_cubes", lambda *_: [])
    monkeypatch.setattr(exploration_index.ExplorationIndex, "_missing", lambda self, target: ())
    with pytest.raises(AssertionError):
        compared(compiled(PLATE))


def test_free_cubes_and_the_seed_are_there_from_the_start():
    found = exploration_index.ExplorationIndex(explore(compiled(PLATE)))
    assert found.seed == 1
    assert found.costs[:2] == [0, 0]
    assert min(found.costs[2:]) == 1
