"""How structures come to be: growths follow the rules, chains are the shortest, parts are found within the whole."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from derived_books import derived

from kinetics.assembly import Placement, RuleBook, Structure, derive
from kinetics.assembly.deriving.explore import StructureEvent
from kinetics.assembly.deriving.history import chain, fits_into, placed_within, random_growth, shortest, way_to

LINE4, T5, PYRAMID = (RuleBook.load(name) for name in ("line4", "t5", "pyramid45"))


@pytest.mark.parametrize("seed", range(5))
def test_a_pyramid_grows_cube_by_cube_to_its_target(seed):
    frames = random_growth(PYRAMID, seed)
    assert [len(frame) for frame in frames] == list(range(1, 46))
    assert frames[-1].canonical("two") == PYRAMID.target.canonical("two")
    for before, after in pairwise(frames):
        assert after.positions[: len(before)] == before.positions  # in the seed's lattice
    assert [str(frame) for frame in random_growth(PYRAMID, seed)] == [str(frame) for frame in frames]


def test_growths_of_different_seeds_differ():
    assert len({random_growth(PYRAMID, seed, max_cubes=10)[9].canonical("two") for seed in range(10)}) > 1


def test_every_grown_structure_is_a_derived_species():
    derivation = derived("pyramid45")
    for frame in random_growth(PYRAMID, seed=3):
        derivation.species_of(frame)  # KeyError if it is none


def test_ways_are_drawn_in_proportion():
    """The second cube docks at each of the seed's four sides equally often (false-alarm rate 1e-6)."""
    n = 2000
    counts = np.zeros(4)
    for seed in range(n):
        x, y, _ = random_growth(PYRAMID, seed, max_cubes=2)[1].positions[1]
        counts[[(1, 0), (-1, 0), (0, 1), (0, -1)].index((x, y))] += 1
    chi2 = ((counts - n / 4) ** 2 / (n / 4)).sum()
    assert chi2 < 30.66  # chi-squared of 3 degrees of freedom
    skewed = counts + n / 20 * np.array([1, -1, 1, -1])
    assert ((skewed - n / 4) ** 2 / (n / 4)).sum() > 30.66  # the control


def test_growth_ends_at_its_cap():
    assert len(random_growth(PYRAMID, 1, max_cubes=7)[-1]) == 7


@pytest.mark.parametrize(("book", "sizes"), [(LINE4, [1, 2, 3, 4]), (T5, [1, 2, 4, 5]), (PYRAMID, [*range(1, 46)])])
def test_chains_nest(book, sizes):
    frames = chain(derived(book.name))
    assert [len(frame) for frame in frames] == sizes
    assert frames[-1] == book.target
    for part, whole in pairwise(frames):
        assert set(part.positions) < set(whole.positions)


def test_shortest_ways():
    """0 + 0 -> 1, 1 + 1 -> 2, 0 + 1 -> 3, 3 + 0 -> 2: two events make 2 of two 1s, counted each time it is needed."""
    events = dict.fromkeys(
        [
            StructureEvent((0, 0), (1,)),
            StructureEvent((1, 1), (2,)),
            StructureEvent((0, 1), (3,)),
            StructureEvent((0, 3), (2,)),
        ]
    )
    costs, made_by = shortest(5, [0], events)
    assert costs == [0, 1, 3, 2, float("inf")]
    assert way_to([2], made_by) == (StructureEvent((0, 0), (1,)), StructureEvent((1, 1), (2,)))
    assert way_to([0], made_by) == ()


def test_parts_are_found_in_the_whole():
    stem = Structure(((0, 0, 0), (1, 0, 0), (2, 0, 0)), (0, 0, 0), ("a", "a", "a"))
    assert fits_into(LINE4.target.part([0, 1, 2]).moved(Placement(7, (5, 0, 0))), LINE4.target, "two")
    assert not fits_into(stem, LINE4.target, "two")  # upright cubes side by side
    assert fits_into(stem, LINE4.target, "one")
    assert not fits_into(PYRAMID.target, LINE4.target, "one")
    free = list(placed_within(stem, LINE4.target, "one", taken=[(0, 0, 0)]))
    assert free
    assert all((0, 0, 0) not in copy.positions for copy in free)


def test_wrong_input():
    with pytest.raises(ValueError, match="has no seed to grow from"):
        random_growth(T5, 1)
    with pytest.raises(ValueError, match="has no target"):
        chain(derive(replace(T5, target=None)))
    with pytest.raises(ValueError, match="never make its target"):
        chain(derive(RuleBook.load("t5_as_printed")))
