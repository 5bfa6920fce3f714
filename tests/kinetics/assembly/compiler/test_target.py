"""Targets as a person writes them down."""

import pytest

from kinetics.assembly import Structure
from kinetics.assembly.compiler import Target
from kinetics.assembly.compiler.target import TARGETS

SHIPPED = sorted(path.stem for path in TARGETS.glob("*.toml"))


@pytest.fixture
def load(tmp_path):
    def write_and_load(text):
        path = tmp_path / "wanted.toml"
        path.write_text(text)
        return Target.load(path)

    return write_and_load


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_targets_load(name):
    target = Target.load(name)
    assert target.name == name
    for scheme in ("one", "two", "six"):
        assert len(target.structure(scheme)) == len(target)


def test_layers_are_read_from_the_lowest_up_and_rows_from_the_highest_down(load):
    target = load('layers = ["z.\\nxx", "..\\ny."]')
    assert target.positions == ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    assert target.tops == ("x", "x", "z", "y")


def test_layers_say_the_same_as_places(load):
    drawn = load('layers = ["#..", "###", "#.."]')
    listed = load("cubes = [[0, 0, 0], [0, 0, 1], [0, 0, 2], [1, 0, 1], [2, 0, 1]]")
    assert drawn.structure("two").canonical("two") == listed.structure("two").canonical("two")


def test_a_drawn_structure_comes_back(load):
    drawn = Target.load("corner").structure("two").drawn()
    columns = zip(*(row.split("   ") for row in drawn.splitlines()), strict=True)
    layers = ["\n".join(row.replace(" ", "") for row in column) for column in columns]
    assert load(f"layers = {layers!r}".replace("'", '"')).positions == Target.load("corner").positions


def test_chosen_turns_let_no_side_face_meet_another_where_that_can_be():
    for positions in (
        ((0, 0, 0), (0, 0, 1), (0, 0, 2), (1, 0, 1), (2, 0, 1)),
        ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)),
    ):
        placed = Target("chosen", positions).structure("two")
        for i, j in placed.bonds:
            faces = {placed.face_towards(i, positions[j]), placed.face_towards(j, positions[i])}
            assert faces & {4, 5}  # a top or a bottom


def test_the_chosen_t_is_the_shipped_one():
    shipped = Target.load("t5")
    chosen = Target("chosen", shipped.positions).structure("two")
    assert chosen.canonical("two") == shipped.structure("two").canonical("two")


def test_senses_and_limits_are_read(load):
    target = load(
        'joins = ["1 + 1", "2.a+1->3.b"]\nbreaks = false\nmax_letters = 5\nlayers = ["##"]\n[senses]\nfaces="six"'
    )
    assert target.joins == ("1+1", "2.a+1->3.b")
    assert target.senses.faces == "six"
    assert (target.breaks, target.max_letters) == (False, 5)
    assert load('joins = "all"\nlayers = ["##"]').joins is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "either as `layers` or as `cubes`"),
        ('layers = ["##"]\ncubes = [[0, 0, 0]]', "either as"),
        ("layers = []", "at least 1"),
        ('layers = ["..", ".."]', "0 cubes"),
        ('layers = ["#"]', "1 cube;"),
        ('layers = ["##", "###"]', "row 1 of layer 2 is one of 1 rows and has 3 characters"),
        ('layers = ["##\\n#"]', "row 2 of layer 1"),
        ('layers = ["#a"]', "'a' in row 1 of layer 1"),
        ('layers = ["#x"]', "of all or of none"),
        ('layers = ["#.#"]', "do not all hang together"),
        ("cubes = [[0, 0, 0], [0, 0, 0]]", "overlap at (0, 0, 0)"),
        ("cubes = [[0, 0, 0], [1, 1, 0]]", "do not all hang together"),
        ("cubes = [[0, 0, 0], [0, 0, 1.5]]", "cubes.1.2 = 1.5"),
        ("cubes = [[0, 0, 0], [0, 0]]", "cubes.1"),
        ("cubes = [[0, 0, 0], [0, 0, 100000]]", "coordinates reach"),
        (f"cubes = {[[0, 0, z] for z in range(251)]}", "251 cubes"),
        ('cubes = [[0, 0, 0], [0, 0, 1]]\ntops = ["z"]', "1 directions for 2 cubes"),
        ('cubes = [[0, 0, 0], [0, 0, 1]]\ntops = ["z", "w"]', "tops.1"),
        ('cubes = [[0, 0, 0], [0, 0, 1]]\nfronts = ["z", "z"]', "fronts without tops"),
        ('layers = ["##"]\ntops = ["z", "z"]', "draw cubes as x, y or z"),
        ('layers = ["##"]\nseed = [5, 0, 0]', "no cube at (5, 0, 0)"),
        ('layers = ["##"]\njoins = ["one"]', "'one' is none"),
        ('layers = ["##"]\njoins = []', "allows none"),
        ('layers = ["##"]\nmax_letters = 1', "max_letters"),
        ('layers = ["##"]\nbreaks = 3', "breaks"),
        ('layers = ["##"]\nsense = 3', "did you mean 'senses'"),
        ("layers = [", "not valid TOML"),
    ],
)
def test_bad_targets_are_refused_with_what_is_wrong(load, text, says):
    with pytest.raises(ValueError, match=r"wanted\.toml") as caught:
        load(text)
    assert says in str(caught.value)


def test_unknown_targets_are_refused():
    with pytest.raises(ValueError, match="shipped are"):
        Target.load("line77")


def test_more_than_eight_cubes_stand_upright():
    target = Target("row", tuple((x, 0, 0) for x in range(9)))
    assert target.structure("two") == Structure(target.positions, (0,) * 9, ("#",) * 9)
