"""The network of a book: the line of four exactly, the defects of the printed table, the orbit identity."""

import random
from collections import Counter
from dataclasses import replace
from itertools import combinations_with_replacement, product

import numpy as np
import pytest
from derived_books import derived

from kinetics.assembly import Placement, RuleBook, Semantics, Senses, Structure, derive, placements
from kinetics.assembly.deriving.ways import RateClass, breaks, joins
from kinetics.assembly.rules.conditions import Combination, Dissociation

LINE4 = RuleBook.load("line4")
PRINTED = RuleBook.load("line4_as_printed")


@pytest.fixture(scope="module")
def line4():
    return derive(LINE4)


def test_line4_is_four_species_and_eight_reactions(line4):
    network = line4.network
    assert network.species == ("monomer", "dimer", "trimer", "quadmer")
    joins_made = ("1+1->2", "1+2->3", "1+3->4", "2+2->4")
    assert network.channels == (*joins_made, "2->1+1", "3->1+2", "4->1+3", "4->2+2")
    assert network.ways.tolist() == [4, 4, 4, 4, 1, 2, 2, 1]
    assert network.reactants.tolist() == [
        *([2, 0, 0, 0], [1, 1, 0, 0], [1, 0, 1, 0], [0, 2, 0, 0]),
        *([0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 1]),
    ]
    assert network.stoichiometry.tolist() == [
        *([-2, 1, 0, 0], [-1, -1, 1, 0], [-1, 0, -1, 1], [0, -2, 0, 1]),
        *([2, -1, 0, 0], [1, 1, -1, 0], [1, 0, 1, -1], [0, 2, 0, -1]),
    ]
    assert np.array_equal(network.conserved["cubes"], [1, 2, 3, 4])
    assert ["".join(s.letters) for s in line4.structures.values()] == ["a", "bb", "bcb", "bddb"]
    assert line4.structures["quadmer"] == LINE4.target.canonical(LINE4.scheme)


def assert_orbit_identity(derivation):
    """N_join = g m N_cut sigma_A sigma_B / (4 sigma_P) for every join (double counting of docked poses).

    g = 2 for like reactants; m = 1, all structures here are trees; sigma is the symmetry number.
    """
    network, scheme = derivation.network, derivation.book.scheme
    structures = list(derivation.structures.values())
    checked = 0
    for r, (before, change) in enumerate(zip(network.reactants, network.stoichiometry, strict=True)):
        if before.sum() != 2:
            continue
        reactants = np.repeat(np.arange(len(before)), before).tolist()
        made = np.flatnonzero(before + change).tolist()
        cut = network.ways[derivation.channel(made, reactants)]
        a, b, p = (structures[s].symmetry_number(scheme) for s in (*reactants, *made))
        like = 2 if reactants[0] == reactants[1] else 1
        assert network.ways[r] == like * cut * a * b / (4 * p), network.channels[r]
        checked += 1
    return checked


def test_orbit_identity_ties_joins_to_breaks(line4):
    assert assert_orbit_identity(line4) == 4


def test_orbit_identity_in_three_dimensions():
    """Side faces carry up to two standing cubes, or pair up in two twists: bent and straight, parallel and crossed."""
    rules = (
        Combination(rule="stand", letter="a", face="f1", partner=["a", "c"], partner_face="f2", becomes="b"),
        Combination(rule="carry", letter="a", face="f2", partner="a", partner_face="f1", becomes="c"),
        Combination(
            rule="carry two", letter="c", face="f2", partner="a", partner_face="f1", neighbours="b", becomes="c"
        ),
        Combination(rule="pair", letter="a", face="f2", partner="a", partner_face="f2", becomes="d"),
    )
    book = RuleBook(
        name="bent",
        letters=("a", "b", "c", "d"),
        initial="a",
        senses=Senses(faces="two"),
        combine=rules,
        dissociate=(Dissociation(rule="alone", neighbours=[], becomes="a"),),
    )
    derivation = derive(book)
    assert [len(s) for s in derivation.structures.values()] == [1, 2, 2, 2, 3, 3]
    assert sorted(derivation.network.ways[:3].tolist()) == [8, 8, 16]  # 4 x 4 sides x half the twists; 2 x 2 x 4
    assert assert_orbit_identity(derivation) == 5


def test_orbit_identity_of_the_t():
    assert assert_orbit_identity(derive(RuleBook.load("t5"))) == 10


def counted(book, a, b):
    """Ways to each product, by trying every pair of faces at every twist: slow, and obvious."""
    ways = Counter()
    for (i, face_i), (j, face_j) in product(a.open_faces(), b.open_faces()):
        for placement in placements(a, i, face_i, b, j, face_j):
            made = book.join(a, i, b, j, placement)
            if made is not None:
                ways[made.canonical(book.scheme)] += 0.25
    return ways


@pytest.mark.parametrize("name", ["line4", "line4_as_printed", "t5", "pyramid45"])
def test_ways_agree_with_trying_every_face_and_twist(name):
    book = RuleBook.load(name)
    structures = list(derived(name).structures.values())
    random.Random(3).shuffle(structures)
    pairs = [(s, book.monomer()) for s in structures[:9]] + list(combinations_with_replacement(structures[:2], 2))
    for a, b in pairs:
        ways = Counter()
        for made, share, _ in joins(book, a, b):
            ways[made.canonical(book.scheme)] += share
        assert ways == counted(book, a, b)


def test_orbit_identity_where_loops_close():
    """m docked faces lead to the same pose: N = m sigma_A sigma_B / (4 sigma_pose), for every join of the pyramid."""
    book = RuleBook.load("pyramid45")
    free = book.monomer()
    checked = 0
    for structure in list(derived("pyramid45").structures.values())[::7]:
        poses, ways = {}, Counter()
        for made, share, _ in joins(book, structure, free):
            pose = structure.joined(Structure(made.positions[-1:], made.rotations[-1:], free.letters)).canonical("two")
            ways[pose] += share
            poses[pose] = pose.symmetry_number("two")
        for pose, sigma in poses.items():
            new = next(c for c, letter in enumerate(pose.letters) if letter == "a")
            rest = pose.part([c for c in range(len(pose)) if c != new])
            facing = (
                (c, pose.face_towards(c, pose.positions[new]), pose.face_towards(new, pose.positions[c]))
                for c in pose.neighbours(new)
            )
            kept = {c: n for n, c in enumerate(c for c in range(len(pose)) if c != new)}
            one = pose.part([new])
            m = sum(
                any(book.join(rest, kept[c], one, 0, p) is not None for p in placements(rest, kept[c], f, one, 0, g))
                for c, f, g in facing
            )
            assert ways[pose] == m * structure.symmetry_number("two") * 8 / (4 * sigma)
            checked += 1
    assert checked > 100


def test_rate_classes_say_which_constants_are_shared(line4):
    names = [str(rate_class) for rate_class in line4.rate_classes]
    sides = ["1 f1 + 1 f1", "1 f1 + 2 f1", "1 f1 + 3 f1", "2 f1 + 2 f1"]
    assert names == [*(f"join {both} touching 1" for both in sides), *(f"break {both}" for both in sides)]
    t5 = derive(RuleBook.load("t5"))
    shared = RateClass("join", (1, 2), ("f1", "f1"))
    channels = [
        c for c, (ways, n) in enumerate(zip(t5.events.values(), t5.network.ways, strict=True)) if ways == {shared: n}
    ]
    assert [t5.network.channels[c] for c in channels] == ["1+dimer.b->trimer.b", "1+dimer.b->trimer.c"]


def test_pyramid_is_closed_and_grows_by_single_cubes():
    made = derived("pyramid45")
    assert made.is_closed
    assert len(made.structures) == 809
    assert list(made.structures)[:2] == ["monomer", "seed"]
    assert made.network.conserved["cubes"].max() == 45
    assert all(0 in event.before and len(event.after) == 1 for event in made.events)
    last = [s for s in made.structures.values() if len(s) == 45]
    assert last == [made.book.target.canonical("two")]


@pytest.mark.parametrize(
    ("scheme", "counts"),
    [("one", [1, 1, 2, 8, 29, 166]), ("two", [1, 4, 25, 337]), ("six", [1, 84])],  # the first: OEIS A000162
)
def test_books_that_allow_everything_make_every_polycube(scheme, counts):
    rule = Combination(rule="stick", becomes="a")
    book = RuleBook("sticky", ("a",), "a", Senses(faces=scheme), combine=(rule,))
    made = derive(book, max_cubes=len(counts), partial=True)
    sizes = Counter(len(s) for s in made.structures.values())
    assert [sizes[n + 1] for n in range(len(counts))] == counts
    assert len(made.beyond.made) == len(counts) + 1


def test_a_partial_derivation_leaves_out_what_lies_beyond():
    book = replace(PRINTED, semantics=PRINTED.semantics.replace(finished=()))
    made = derive(book, max_cubes=5, partial=True)
    assert not made.is_closed
    assert made.beyond is not None
    assert len(made.beyond.made) == 6
    assert made.network.conserved["cubes"].max() == 5
    few = derive(book, max_cubes=5, max_species=6, partial=True)
    assert "more than max_species = 6" in few.stopped


def test_interruption_keeps_what_was_found():
    def stop(explored, found):
        assert 0 < explored <= found
        raise KeyboardInterrupt

    assert derive(LINE4, partial=True, progress=stop).stopped == "interrupted with 1 of 2 structures explored"
    with pytest.raises(KeyboardInterrupt):
        derive(LINE4, progress=stop)


def test_species_are_found_in_any_pose(line4):
    trimer = Structure(((5, 5, 5), (6, 5, 5), (4, 5, 5)), (0, 0, 0), ("c", "b", "b"))
    with pytest.raises(KeyError, match="not among the 4 species of book 'line4'"):
        line4.species_of(trimer)  # side by side instead of end to end
    for rotation in range(24):
        for index, structure in enumerate(line4.structures.values()):
            assert line4.species_of(structure.moved(Placement(rotation, (7, -3, 1)))) == index


def test_channels_are_found_in_any_order(line4):
    assert line4.channel([2, 0], [3]) == line4.channel((0, 2), (3,)) == 2
    assert line4.network.channels[line4.channel([3], [1, 1])] == "4->2+2"
    with pytest.raises(KeyError, match="turns monomer \\+ quadmer into dimer"):
        line4.channel([3, 0], [1])


def test_printed_table_makes_lines_of_five_and_six():
    """Defects L1 and L5: no guard on P2; lone b after a break."""
    found = derive(PRINTED, max_cubes=8)
    letters = {"".join(s.letters) for s in found.structures.values()}
    assert {"bdddb", "bddddb"} <= letters
    assert "b" in letters
    assert max(map(len, found.structures.values())) == 6
    sizes = found.network.conserved["cubes"].tolist()
    assert found.network.species[: sizes.count(1)] == ("monomer.a", "monomer.b", "monomer.c", "monomer.d")
    assert any(channel.endswith("->6") for channel in found.network.channels)


@pytest.mark.parametrize(
    "semantics",
    [
        PRINTED.semantics.replace(conflict="first"),  # L2: P3 shadows P4
        PRINTED.semantics.replace(gate="any"),  # L3
        PRINTED.semantics.replace(update="sequential"),  # L4
        PRINTED.semantics.replace(finished=()),  # L6
    ],
    ids=["first", "any", "sequential", "lit"],
)
def test_printed_table_grows_without_end_under_other_semantics(semantics):
    with pytest.raises(ValueError, match=r"not closed under max_cubes = 6: the join of .* has 7 cubes"):
        derive(replace(PRINTED, semantics=semantics), max_cubes=6, max_species=4000)


def test_repaired_table_does_not_need_the_dark_leds(line4):
    dark = derive(replace(LINE4, semantics=PRINTED.semantics))
    assert dark.network.channels == line4.network.channels
    assert np.array_equal(dark.network.ways, line4.network.ways)


def test_caps_name_what_went_beyond_them():
    with pytest.raises(ValueError, match="more than max_species = 3 structures, the last by the join of"):
        derive(LINE4, max_species=3)
    with pytest.raises(ValueError, match="both must be at least 1"):
        derive(LINE4, max_cubes=0)


def test_sequential_updates_weigh_both_orders(line4):
    """A free cube that writes first lets the dimer see b (b becomes d, settles to c); else it finds c and stays a."""
    book = replace(PRINTED, semantics=Semantics(conflict="most-specific", update="sequential"))
    monomer, dimer = line4.structures["monomer"], line4.structures["dimer"]
    shares: Counter[str] = Counter()
    for joined, share, _ in joins(book, monomer, dimer):
        letters = "".join(joined.canonical("two").letters)
        shares[min(letters, letters[::-1])] += share
    assert shares == {"bcb": 2, "acb": 2}
    assert [share for _, share, _ in breaks(book, dimer)] == [0.5, 0.5]


def test_a_book_without_rules_is_free_cubes():
    network = derive(RuleBook(name="gas", letters=("a",), initial="a", senses=Senses(faces="two"))).network
    assert network.species == ("monomer",)
    assert network.channels == ()
