"""Faces, rotations and structures: group laws, known counts of polycubes, invariance of the canonical form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinetics.assembly import FACE_NORMALS, ROTATIONS, SCHEMES, Placement, Structure, compose, inverse, placements
from kinetics.assembly.faces import scheme_of, turned

CUBE = Structure(((0, 0, 0),), (0,), ("a",))
LINE = Structure(((0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 0, 3)), (0, 0, 0, 0), ("b", "d", "d", "b"))
SQUARE = Structure(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), (0, 0, 0, 0), ("a", "a", "a", "a"))


def test_rotations_are_the_proper_ones_and_form_a_group():
    assert len({m.tobytes() for m in ROTATIONS}) == 24
    assert np.array_equal(ROTATIONS[0], np.eye(3))
    assert np.allclose(np.linalg.det(ROTATIONS), 1)
    for a in range(24):
        assert compose[a, inverse[a]] == 0
        for b in range(24):
            assert np.array_equal(ROTATIONS[compose[a, b]], ROTATIONS[a] @ ROTATIONS[b])


def test_turned_faces_look_where_the_matrix_says():
    for rotation, matrix in enumerate(ROTATIONS):
        assert np.array_equal(FACE_NORMALS[turned[rotation]], FACE_NORMALS @ matrix.T)


def test_face_schemes_see_what_they_should():
    assert {name: len(scheme.symmetry) for name, scheme in SCHEMES.items()} == {"one": 24, "two": 8, "six": 1}
    assert {name: CUBE.symmetry_number(name) for name in SCHEMES} == {"one": 24, "two": 8, "six": 1}
    assert SCHEMES["two"].types[4] == SCHEMES["two"].types[5] == "f1"
    with pytest.raises(ValueError, match="unknown face scheme 'three'; known are one, two, six"):
        scheme_of("three")


def grown(scheme, size):
    """Counts of distinct structures of 1..size cubes that stick in any way."""
    seen_rotations = sorted(set(SCHEMES[scheme].reduced.tolist()))
    structures, counts = {CUBE}, [1]
    for _ in range(size - 1):
        structures = {
            Structure((*s.positions, place), (*s.rotations, rotation), (*s.letters, "a")).canonical(scheme)
            for s in structures
            for place in {s.faced(cube, face) for cube, face in s.open_faces()}
            for rotation in seen_rotations
        }
        counts.append(len(structures))
    return counts


def test_sticky_cubes_make_the_known_numbers_of_polycubes():
    assert grown("one", 7) == [1, 1, 2, 8, 29, 166, 1023]  # OEIS A000162
    assert grown("two", 4) == [1, 4, 25, 337]
    assert grown("six", 2) == [1, 84]


@st.composite
def structures(draw, max_size=7):
    """A random connected structure with letters a, b."""
    positions = [(0, 0, 0)]
    for _ in range(draw(st.integers(0, max_size - 1))):
        around = {(x + u, y + v, z + w) for x, y, z in positions for u, v, w in FACE_NORMALS.tolist()} - set(positions)
        positions.append(draw(st.sampled_from(sorted(around))))
    n = len(positions)
    rotations = draw(st.lists(st.integers(0, 23), min_size=n, max_size=n))
    letters = draw(st.lists(st.sampled_from("ab"), min_size=n, max_size=n))
    return Structure(tuple(positions), tuple(rotations), tuple(letters))


@settings(max_examples=40, deadline=None)
@given(structures(), st.integers(0, 23), st.tuples(*[st.integers(-9, 9)] * 3), st.randoms(), st.data())
def test_canonical_form_forgets_place_turn_numbering_and_unseen_turns(structure, rotation, shift, random, data):
    for scheme in SCHEMES:
        order = list(range(len(structure)))
        random.shuffle(order)
        other = structure.part(order).moved(Placement(rotation, shift))
        unseen = data.draw(st.sampled_from(SCHEMES[scheme].symmetry))
        other = Structure(
            other.positions, (int(compose[other.rotations[0], unseen]), *other.rotations[1:]), other.letters
        )
        assert other.canonical(scheme) == structure.canonical(scheme)
        assert other.symmetry_number(scheme) == structure.symmetry_number(scheme)
        assert structure.canonical(scheme).canonical(scheme) == structure.canonical(scheme)


@settings(max_examples=30, deadline=None)
@given(structures(max_size=4))
def test_canonical_form_agrees_with_a_slow_obvious_one(structure):
    def slow(scheme):
        copies = []
        for r in range(24):
            moved = structure.moved(Placement(r, (0, 0, 0)))
            low = np.min(moved.positions, axis=0)
            cubes = zip(moved.positions, moved.rotations, moved.letters, strict=True)
            copies.append(sorted((tuple((p - low).tolist()), int(SCHEMES[scheme].reduced[q]), x) for p, q, x in cubes))
        return min(copies), copies.count(min(copies))

    for scheme in SCHEMES:
        canonical = structure.canonical(scheme)
        cubes = list(zip(canonical.positions, canonical.rotations, canonical.letters, strict=True))
        assert (cubes, structure.symmetry_number(scheme)) == slow(scheme)


def test_letters_and_turned_cubes_are_told_apart():
    two = Structure(((0, 0, 0), (0, 0, 1)), (0, 0), ("a", "a"))
    assert two.canonical("two") != two.with_letters("ab").canonical("two")
    lying = next(r for r in range(24) if SCHEMES["two"].reduced[r] != 0)
    bent = Structure(two.positions, (0, lying), two.letters)
    assert bent.canonical("two") != two.canonical("two")
    assert bent.canonical("one") == two.canonical("one")


def test_symmetry_numbers():
    assert LINE.symmetry_number("two") == 8
    assert LINE.with_letters("bddc").symmetry_number("two") == 4
    assert LINE.symmetry_number("six") == 1
    assert SQUARE.symmetry_number("one") == 8


def test_symmetries_put_a_structure_onto_itself():
    turned_line = LINE.moved(Placement(9, (4, -2, 7)))
    for structure in (LINE, turned_line, SQUARE):
        for scheme in ("one", "two", "six"):
            found = structure.symmetries(scheme)
            assert len(found) == structure.symmetry_number(scheme)
            assert found[0] == Placement(0, (0, 0, 0))
            assert all(set(map(placement.of, structure.positions)) == set(structure.positions) for placement in found)


def test_a_structure_is_drawn_in_layers():
    bent = Structure(((0, 0, 0), (1, 0, 0), (1, 0, 1)), (0, 0, 0), ("a", "b", "c"))
    assert bent.drawn() == "a b   . c"
    assert SQUARE.with_letters("abcd").drawn() == "d c\na b"


def test_bonds_neighbours_and_sides():
    assert LINE.bonds == ((0, 1), (1, 2), (2, 3))
    assert sorted(LINE.neighbours(1)) == [0, 2]
    assert LINE.cube_at((0, 0, 2)) == 2
    assert LINE.cube_at((1, 0, 2)) is None
    assert LINE.sides(1, 2) == ((0, 1), (2, 3))
    assert LINE.sides(2, 1) == ((2, 3), (0, 1))
    assert len(LINE.open_faces()) == 18
    assert SQUARE.bonds == ((0, 1), (0, 3), (1, 2), (2, 3))
    assert SQUARE.sides(0, 1) is None
    with pytest.raises(ValueError, match="cubes 0 and 2 do not touch"):
        LINE.sides(0, 2)


@pytest.mark.parametrize(("face_i", "face_j"), [(4, 5), (4, 4), (0, 3), (2, 2)])
def test_placements_bring_the_two_faces_together_in_four_twists(face_i, face_j):
    a, b = LINE.moved(Placement(7, (3, 1, 2))), SQUARE.moved(Placement(13, (-1, 0, 5)))
    four = placements(a, 0, face_i, b, 2, face_j)
    assert len({placement.rotation for placement in four}) == 4
    for placement in four:
        placed = b.moved(placement)
        assert placed.positions[2] == a.faced(0, face_i)
        assert placed.face_towards(2, a.positions[0]) == face_j
        assert a.face_towards(0, placed.positions[2]) == face_i


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (((), (), ()), "at least one cube"),
        ((((0, 0, 0),), (0, 0), ("a",)), "1 positions, 2 rotations, 1 letters"),
        ((((0, 0, 0), (0, 0, 0)), (0, 0), ("a", "a")), r"overlap at \(0, 0, 0\)"),
        ((((0, 0, 0), (0, 0, 2)), (0, 0), ("a", "a")), "do not all hang together"),
        ((((0, 0, 0),), (24,), ("a",)), "index from 0 to 23"),
    ],
)
def test_impossible_structures_are_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        Structure(*fields)
