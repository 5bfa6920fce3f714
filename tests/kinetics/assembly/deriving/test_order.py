"""The order of growth: the pyramid of section VII keeps the paper's, and what a book says of its own order is true."""

from collections import Counter
from dataclasses import replace

import pytest
from derived_books import derived

from kinetics.assembly import RuleBook
from kinetics.assembly.deriving.explore import StructureEvent
from kinetics.assembly.deriving.order import stages, stages_in_words
from tests.helpers.section_vii import growth_steps, out_of_order

PYRAMID = RuleBook.load("pyramid45")


def counted(book, slow_waves=False):
    return Counter(out_of_order(*step) for step in growth_steps(book, slow_waves))


def hurried(book):
    """The same rules, but either side goes on without waiting for the other."""
    changes = {"layers begin": {"neighbours": ("b",)}, "layer complete": {"neighbours": ("b", "e", "e", "e", "e")}}
    changes["layer complete"]["becomes"] = "b"
    internal = tuple(rule.replace(**changes.get(rule.rule, {})) for rule in book.internal)
    return replace(book, internal=internal)


def test_the_pyramid_keeps_the_order_of_section_vii():
    """Both centres, then both 3x3 plates, then the tips, in each of 4,505 dockings up to symmetry."""
    assert counted(PYRAMID) == {None: 4505}


def test_a_side_that_does_not_wait_is_counted():
    """The control: it grows the same pyramid, but out of order."""
    assert counted(hurried(PYRAMID)) == {None: 4546, "centres": 26, "3x3 plates": 15}


@pytest.mark.validate
def test_the_order_holds_in_the_middle_of_waves():
    said = counted(PYRAMID, slow_waves=True)
    assert set(said) == {None}
    assert said[None] > 4505
    assert {"centres", "3x3 plates"} <= set(counted(hurried(PYRAMID), slow_waves=True))


def ends(name):
    made = derived(name)
    return stages(tuple(made.structures.values()), made.events, made.book.scheme)


def layers(structure):
    return sorted(Counter(z for _, _, z in structure.positions).values(), reverse=True)


def test_the_stages_of_the_pyramid():
    found = ends("pyramid45")
    assert list(map(len, found)) == [5, 25, 27, 43, 45]
    assert [layers(end) for end in found[1:]] == [[25], [25, 1, 1], [25, 9, 9], [25, 9, 9, 1, 1]]
    assert stages_in_words(found).startswith("order: every growth passes through the same structures of 5, 25, 27, 43")


@pytest.mark.validate
def test_the_compiled_pyramid_has_an_order_of_its_own():
    """Its file states it."""
    found = ends("pyramid45_compiled")
    assert list(map(len, found)) == [19, 37, 45]
    assert set(counted(RuleBook.load("pyramid45_compiled"))) == {None, "plate", "3x3 plates"}


def test_stages_need_a_growth_by_single_cubes():
    made = derived("t5")
    with pytest.raises(ValueError, match="one by one"):
        stages(tuple(made.structures.values()), made.events, "two")
    grown = derived("pyramid45")
    structures = tuple(grown.structures.values())
    two = (PYRAMID.monomer(), PYRAMID.seed(), *(structures[2].with_letters(pair) for pair in ("cb", "cc")))
    with pytest.raises(ValueError, match="different structures of 2 cubes"):
        stages(two, [StructureEvent((0, 1), (2,))], "two")
    assert "any order" in stages_in_words(structures[2:3])
