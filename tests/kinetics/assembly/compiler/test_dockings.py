"""How parts meet, against every placement of one beside the other as the rule book itself sees it."""

from itertools import product

import pytest

from kinetics.assembly import RuleBook, Senses
from kinetics.assembly.compiler import Target
from kinetics.assembly.compiler.dockings import Dockings
from kinetics.assembly.compiler.plan import planned
from kinetics.assembly.structure import placements

SENSES = [
    Senses(faces="two"),
    Senses(faces="two", touched=True),
    Senses(faces="two", roll=True, across=True, touched=True),
    Senses(faces="six", roll=True, across=True),
]


def every_meeting(dockings, senses):
    """What two cubes read in every join, and in every other meeting; letters are the numbers of unknowns."""
    book = RuleBook("reader", ("#",), "#", senses)
    parts = dockings.parts
    structures = [part.structure.with_letters(tuple(map(str, part.unknowns))) for part in parts.parts]
    found = {True: set(), False: set()}
    for a, first in enumerate(structures):
        for b, second in enumerate(structures[: a + 1]):
            for (i, f), (j, g) in product(first.open_faces(), second.open_faces()):
                for placement in placements(first, i, f, second, j, g):
                    placed = second.moved(placement)
                    if first.places.keys().isdisjoint(placed.places):
                        own, other = book.view(first, i, f, placed, j), book.view(placed, j, g, first, i)
                        both = first.joined(placed)
                        is_join = parts.known(both.with_letters(("#",) * len(both))) is not None
                        found[is_join].add((a, b, frozenset([(own, other[:2]), (other, own[:2])])))
    return found


def views(docking):
    """The readings of two cubes as the rule book's views."""
    return frozenset(
        (
            (
                str(r.own),
                r.face,
                tuple(sorted(map(str, r.around))),
                "" if r.across < 0 else str(r.across),
                r.roll,
                None if r.touched is None else tuple(sorted(map(str, r.touched))),
            ),
            (str(r.partner), r.partner_face),
        )
        for r in docking
    )


@pytest.mark.parametrize("name", ["l3", pytest.param("corner", marks=pytest.mark.validate)])
def test_all_meetings_are_there_once_whatever_cubes_sense(name):
    for faces in ("two", "six"):
        dockings = Dockings(Target.load(name), faces)
        for senses in (each for each in SENSES if each.faces == faces):
            plan, expected = planned(dockings, senses), every_meeting(dockings, senses)
            joins = {(*join[:2], views(docking)) for join, ways in plan.joins.items() for docking in ways}
            assert joins == expected[True]
            pairs = [(a, b) for a in range(len(plan.parts)) for b in range(a + 1)]
            foreign = {(a, b, views(docking)) for a, b in pairs for docking in plan.foreign(a, b)}
            assert foreign <= expected[False]
            shown = {shape(view, other) for _, _, docking in joins for view, other in docking}
            for a, b, docking in expected[False] - foreign:  # cubes that are never read so where they must bond
                assert not all(shape(view, other) in shown for view, other in docking), (a, b)
            assert foreign & expected[False]


def shape(view, other):
    """All of a view but the letters."""
    return view[1], other[1], len(view[2]), view[3] == "", view[4], len(view[5] or ())


def test_a_target_that_is_turned_otherwise_meets_otherwise():
    """The control: the same comparison sees which way cubes are turned."""
    line = [(0, 0, z) for z in range(3)]
    upright, lying = (Dockings(Target("line", tuple(line), tops=(top,) * 3), "two") for top in "zx")
    senses = SENSES[0]
    joins = {(*join[:2], views(docking)) for join, ways in planned(upright, senses).joins.items() for docking in ways}
    assert joins == every_meeting(upright, senses)[True] != every_meeting(lying, senses)[True]
