"""What cubes sense: the twist, the letter across, the letters touched; one view answers for all."""

from dataclasses import replace

import pytest

from kinetics.assembly import ROTATIONS, Placement, RuleBook, Senses, Structure, View, derive, explore, placements
from kinetics.assembly.faces import roll, turned
from kinetics.assembly.rules.conditions import BookFile, Combination
from kinetics.support.settings import validated

TWO = Senses(faces="two", roll=True, across=True, touched=True)


def book(*combine, letters="ab", senses=TWO):
    return RuleBook("made up", tuple(letters), letters[0], senses, combine=combine)


def stick(name="stick", **conditions):
    return Combination(rule=name, becomes="a", **conditions)


def meetings():
    """(rotation, face, partner's rotation, partner's face) of all ways in which two cubes can meet along +z."""
    for first in range(24):
        for second in range(24):
            face = turned[first].tolist().index(4)
            partner_face = turned[second].tolist().index(5)
            yield first, face, second, partner_face


def test_both_cubes_see_the_same_twist_however_the_pair_is_turned():
    for scheme in ("two", "six"):
        for first, face, second, partner_face in meetings():
            seen = roll(scheme, first, face, second)
            assert roll(scheme, second, partner_face, first) == seen
            for r in (5, 17):
                turned_pair = (int(_compose(r, first)), face, int(_compose(r, second)))
                assert roll(scheme, *turned_pair) == seen


def _compose(a, b):
    return next(i for i, matrix in enumerate(ROTATIONS) if (matrix == ROTATIONS[a] @ ROTATIONS[b]).all())


def test_twist_tells_what_the_faces_let_it():
    """Side faces: two of the four twists are parallel. Six faces: four twists, four angles."""
    free = Structure(((0, 0, 0),), (0,), ("a",))
    for face_a, face_b, two in ((0, 2, ["crossed", "parallel"]), (4, 5, ["parallel"]), (0, 4, ["crossed"])):
        four = [p.rotation for p in placements(free, 0, face_a, free, 0, face_b)]
        assert sorted({roll("two", 0, face_a, r) for r in four}) == two
        assert sorted(roll("six", 0, face_a, r) for r in four) == ["0", "180", "270", "90"]
    with pytest.raises(ValueError, match="shows no twist"):
        roll("one", 0, 0, 0)


def test_view_leaves_open_what_only_docking_shows():
    corner = Structure(((0, 0, 0), (1, 0, 0), (1, 1, 0)), (0, 0, 0), ("a", "b", "a"))
    free = Structure(((0, 0, 0),), (0,), ("a",))
    made = book(stick())
    assert made.view(corner, 0, 1) == View("a", "f2", ("b",), "b")
    assert made.view(corner, 0, 4) == View("a", "f1", ("b",), "")
    placed = free.moved(Placement(0, (0, 1, 0)))
    assert made.view(placed, 0, 3, corner, 0) == View("a", "f2", (), "", "parallel", ("a", "a"))
    assert made.view(corner, 0, 2, placed, 0) == View("a", "f2", ("b",), "", "parallel", ("a",))
    plain = book(stick(), senses=Senses(faces="two"))
    assert plain.view(placed, 0, 3, corner, 0) == View("a", "f2", ())  # cubes that sense no more read no more


@pytest.mark.parametrize(
    ("conditions", "made"),
    [
        ({"roll": "parallel", "face": "f2"}, 1),
        ({"roll": "crossed", "face": "f2", "partner_face": "f2"}, 1),
        ({"face": "f2", "partner_face": "f2"}, 2),
        ({"face": "f1", "partner_face": "f1"}, 1),
    ],
)
def test_the_twist_decides_at_docking(conditions, made):
    dimers = [s for s in explore(book(stick(**conditions)), max_cubes=2).structures if len(s) == 2]
    assert len(dimers) == made


def test_six_faces_with_twist_make_one_dimer():
    made = book(stick(face="f1", partner_face="f1", roll="90"), letters="a", senses=Senses(faces="six", roll=True))
    derivation = derive(made)
    assert len(derivation.structures) == 2
    assert derivation.network.ways.tolist() == [0.25, 1.0]  # one pair of faces at one twist of four


def test_across_tells_the_end_of_a_line():
    """f1 docks only where nothing is across: lines of two and, end to end, no more."""
    ends = book(stick(face="f1", partner_face="f1", across=""))
    assert [len(s) for s in derive(ends).structures.values()] == [1, 2]
    lines = book(stick(face="f1", partner_face="f1", across=["", "a"]))
    assert derive(lines, max_cubes=3, partial=True).beyond is not None


def test_touched_letters_decide_at_docking():
    """A square closes only where the last cube touches two."""
    shut = stick("shut", face="f2", partner_face="f2", roll="parallel", touched=["a", "a"], neighbours=[])
    host = stick("host", face="f2", partner_face="f2", touched="a", has="a")
    made = book(shut, host)
    corner = Structure(((0, 0, 0), (1, 0, 0), (1, 1, 0)), (0, 0, 0), ("a", "a", "a"))
    free = made.monomer()

    def outcomes(cube, face):
        return [made.join(corner, cube, free, 0, p) for p in placements(corner, cube, face, free, 0, 0)]

    assert made.allows(made.view(corner, 0, 2), made.view(free, 0, 0))  # may be: the twist is not known yet
    assert sum(structure is not None for structure in outcomes(0, 2)) == 2  # parallel, not crossed
    assert made.allows(made.view(corner, 0, 1), made.view(free, 0, 0))
    assert not any(outcomes(0, 1))  # touches one cube only


def test_has_asks_for_at_least_these():
    asks = stick("two", has=["a", "b"])
    line = Structure(((0, 0, 0), (0, 0, 1), (0, 0, 2)), (0, 0, 0), ("a", "a", "b"))
    made = book(asks, senses=Senses(faces="two"))
    assert made.allows(made.view(line, 1, 0), made.view(line, 1, 0))
    assert not made.allows(made.view(line, 0, 0), made.view(line, 1, 0))
    with pytest.raises(ValueError, match="rules two and b contradict"):
        book(asks, Combination(rule="b", neighbours=["a", "a", "b"], becomes="b"), senses=Senses(faces="two"))
    book(asks, Combination(rule="b", neighbours=["a", "a"], becomes="b"), senses=Senses(faces="two"))


def test_declarations_enter_the_fingerprint_only_where_used():
    plain = book(stick(), senses=Senses(faces="two"))
    others = [
        book(stick()),
        replace(plain, senses=Senses(faces="two", roll=True)),
        replace(plain, seed_letter="b"),
        book(stick(has="a"), senses=Senses(faces="two")),
        replace(plain, semantics=plain.semantics.replace(bonds="hold")),
    ]
    assert len({other.fingerprint for other in (plain, *others)}) == 6


@pytest.mark.parametrize(
    ("senses", "conditions", "message"),
    [
        ({"faces": "two"}, {"roll": "parallel"}, r"rule stick, roll: the cubes do not sense this; set roll = true"),
        ({"faces": "two"}, {"touched": "a"}, "rule stick, touched: the cubes do not sense this"),
        ({"faces": "two"}, {"across": ""}, "rule stick, across: the cubes do not sense this"),
        ({"faces": "one", "roll": True}, {}, "senses.roll: the faces of scheme 'one' show no twist"),
        ({"faces": "two", "roll": True}, {"roll": "90"}, "unknown roll '90'; the rolls of scheme 'two' are parallel"),
        ({"faces": "six", "roll": True}, {"roll": 45}, "unknown roll '45'; the rolls of scheme 'six' are 0, 90"),
        ({"faces": "two", "touched": True}, {"touched": "z"}, "rule stick, touched: unknown letter 'z'"),
        ({"faces": "two", "across": True}, {"across": ["", "z"]}, "rule stick, across: unknown letter 'z'"),
        ({"faces": "two", "twist": True}, {}, "unknown key 'senses.twist'; allowed here: across, faces, roll, touched"),
        ({"faces": "two", "roll": 1}, {}, "senses.roll"),
    ],
)
def test_mistakes_about_senses_are_explained(senses, conditions, message):
    data = {
        "letters": ["a", "b"],
        "initial": "a",
        "senses": senses,
        "combine": [{"rule": "stick", "becomes": "a", **conditions}],
    }

    def read():
        content = validated(BookFile, data, "book.toml")
        return RuleBook("made up", content.letters, content.initial, content.senses, combine=content.combine)

    with pytest.raises(ValueError, match=message):
        read()


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ({"cubes": [[0, 0, 0]], "letters": ["a"], "tops": ["z", "z"]}, "target.tops has 2 directions for 1 cubes"),
        ({"cubes": [[0, 0, 0]], "letters": ["a"], "tops": ["z"], "fronts": ["-z"]}, "must be at right angles"),
        ({"cubes": [[0, 0, 0]], "letters": ["a"], "tops": ["up"]}, "target.tops.0"),
    ],
)
def test_mistakes_about_targets_are_explained(target, message):
    data = {"letters": ["a"], "initial": "a", "senses": {"faces": "two"}, "target": target}
    with pytest.raises(ValueError, match=message):
        validated(BookFile, data, "book.toml").target.structure()
