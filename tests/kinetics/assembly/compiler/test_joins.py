"""Sets of joins by clauses, against all subsets tried one by one."""

from itertools import combinations

import pytest

from kinetics.assembly import Senses
from kinetics.assembly.compiler import Target
from kinetics.assembly.compiler.budget import Budget
from kinetics.assembly.compiler.clauses import Clauses
from kinetics.assembly.compiler.dockings import Dockings
from kinetics.assembly.compiler.joins import JoinSearch, sensible
from kinetics.assembly.compiler.orientation import turnings
from kinetics.assembly.compiler.plan import planned
from kinetics.assembly.compiler.reasons import clashes, obstacles

CASES = [
    ("line4", Senses(faces="two"), True),
    ("line4", Senses(faces="two"), False),
    ("corner", Senses(faces="two", across=True), True),
    ("screw", Senses(faces="six", roll=True), True),
    ("plate2x2", Senses(faces="two", roll=True), True),
    ("plate2x2", Senses(faces="two", roll=True, across=True, touched=True), True),
]


def plan_of(name, senses, breaks):
    return planned(Dockings(Target.load(name), senses.faces), senses, breaks)


def search(plan):
    return JoinSearch(plan, plan.joins, Clauses(1, Budget()))


def all_sets(plan):
    """Every subset that leads home and holds no clash."""
    subsets = (frozenset(some) for n in range(1, len(plan.joins) + 1) for some in combinations(plan.joins, n))
    return {s for s in subsets if sensible(plan, s) == s and not any(clashes(plan, s))}


@pytest.mark.parametrize(("name", "senses", "breaks"), CASES)
def test_every_set_is_found_once(name, senses, breaks):
    plan = plan_of(name, senses, breaks)
    expected = all_sets(plan)
    found = list(search(plan).every())
    assert len(found) == len(set(found))
    assert set(found) == expected
    smallest = list(search(plan).smallest())
    assert len(smallest) == len(set(smallest))
    assert set(smallest) == {s for s in expected if not any(other < s for other in expected)}


def test_some_sets_are_refused_and_some_are_not():
    """The control: the comparison is of something."""
    counts = [(len(all_sets(plan_of(name, senses, breaks)))) for name, senses, breaks in CASES]
    assert min(counts) == 0 < max(counts)


def test_joins_whose_cubes_read_the_same_come_together_or_not_at_all():
    places = ((0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 0), (0, 1, 1))
    seen = 0
    for tops in turnings(places):
        plan = planned(Dockings(Target("p", places, tops=tops), "two"), Senses(faces="two", roll=True))
        for found in search(plan).every():
            for join in found:
                needed = {clash.made for clash in clashes(plan, [join])}
                assert needed <= found
                seen += len(needed)
    assert seen


@pytest.mark.parametrize(("name", "senses", "breaks"), CASES)
def test_obstacles_are_said_where_there_is_no_set(name, senses, breaks):
    plan = plan_of(name, senses, breaks)
    if not all_sets(plan):
        found = obstacles(plan, plan.joins)
        left = frozenset(plan.joins).difference(*(clash.blamed for clash in found))
        assert found
        assert not sensible(plan, left)
