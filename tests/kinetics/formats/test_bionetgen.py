"""BioNetGen's .net files: what they say, what they cannot say, and what is wrong with them."""

import importlib.util
import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose, assert_array_equal

from kinetics.formats import FORMATS, SUFFIXES, read, write
from kinetics.formats.base import Model
from kinetics.formats.formulas import number
from kinetics.network import Network
from wellmixed import main

# Every notation at once: numbers as formulas, a held count, pairs, factors, groups, functions and laws with names.
EVERYTHING = """
# made by hand
begin parameters
    1 Na   6.022e23  # Constant
    2 V    1e-21
    3 kon  0.212*Na*V/100  # ConstantExpression
    4 half (1+2)^2/6
    5 K    40
    6 out  0.25
end parameters
begin functions
    1 one() kon/(K+bound)
    2 two() if(bound>2 && free<=30, one()*half, exp(-free/10))
end functions
begin species
    1 $Source() 1
    2 A(b) 20
    3 B() half*8
    4 A(b!1).B() 5
end species
begin reactions
    1 1 1,2 kon #feed
    2 2,2 4 0.5*half #pair
    3 2,3 4 3*kon #bind
    4 4 2,3 one #unbind
    5 2,3,3 3 2*two #both
    6 2,3 3 Sat half K #sat
    7 3,4 4 Hill half K 2.5 #hill
    8 2,3 3 MM half K #mm
    9 0 3 half #in
    10 3 0 out #out
end reactions
begin groups
    1 bound 4,2*2
    2 free  3
    3 none
end groups
"""


def written(folder, text, name="model.net"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_everything_a_file_can_say(tmp_path):
    model = read(written(tmp_path, EVERYTHING))
    net = model.network
    assert net.species == ("Source", "A(b)", "B", "A(b!1).B()")
    assert net.channels == ("feed", "pair", "bind", "unbind", "both", "sat", "hill", "mm", "in", "out")
    assert_array_equal(model.initial, [1, 20, 12, 5])
    assert model.observables == {"bound": {"A(b!1).B()": 1, "A(b)": 2}, "free": {"B": 1}, "none": {}}
    for a, b, ab in ((20, 12, 5), (1, 31, 0), (2, 1, 7)):
        kon, half, K = 1.276664, 1.5, 40.0
        one = kon / (K + ab + 2 * a)
        two = one * half if ab + 2 * a > 2 and b <= 30 else math.exp(-b / 10)
        free = (a - K - b + math.sqrt((a - K - b) ** 2 + 4 * K * a)) / 2
        expected = [
            kon,
            0.5 * half * a * (a - 1),
            3 * kon * a * b,
            one * ab,
            2 * two * a * b * (b - 1),
            half * a * b / (K + a),
            half * b**2.5 / (K**2.5 + b**2.5) * ab,
            half * b * free / (K + free),
            half,
            0.25 * b,
        ]
        assert_allclose(net.propensities([1, a, b, ab]), expected, rtol=1e-12)
    assert_array_equal(net.stoichiometry[0], [0, 1, 0, 0])  # the source is needed, and held
    assert_array_equal(net.stoichiometry[4], [0, -1, -1, 0])


def test_the_same_as_the_engine_of_the_format(tmp_path):
    if importlib.util.find_spec("bngsim") is None:
        pytest.skip("bngsim is not installed; see the extra `peers`")
    import bngsim

    path = written(tmp_path, EVERYTHING)
    ours = read(path).network
    with pytest.warns(UserWarning, match="Sat"):
        theirs = bngsim.Model.from_net(str(path))
    for state in np.random.default_rng(1).integers(2, 40, (20, 4)):
        state[0] = 1
        assert_allclose(ours.propensities(state), theirs.propensities(state.astype(float)), rtol=1e-12)


def test_what_a_net_file_cannot_say(tmp_path):
    squares = Network.from_reactions({"pair": ({"A": 2}, {"B": 1})}, [2.0], combinations="product")
    with pytest.raises(ValueError, match="it cannot express `product` combinations"):
        write(Model(squares, [3, 0]), tmp_path / "out.net")
    assert not (tmp_path / "out.net").exists()
    law = Network.from_reactions({"turn": ({"A": 1}, {"B": 1})}, ["2 * A / (3 + A)"])
    with pytest.raises(ValueError, match="law of channel 'turn'"):
        write(Model(law, [3, 0]), tmp_path / "out.net")
    with pytest.raises(ValueError, match=r"must end in .*\.net"):
        write(Model(law, [3, 0]), tmp_path / "out.csv")


GOOD = """begin parameters
1 k 0.5
end parameters
begin species
1 A() 10
2 B() 0
end species
begin reactions
1 1,1 2 k
end reactions
begin groups
1 both 1,2*2
end groups
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1 k 0.5", "1 k 1/0", "line 2: '1/0' comes to inf"),
        ("1 k 0.5", "1 k m", "line 2: 'm' is not known here"),
        ("1 k 0.5", "1 k", "line 2: '1 k' came; a parameter is `name value`"),
        ("1 k 0.5", "1 k 0.5\n2 k 1", "line 3: parameter 'k' comes twice"),
        ("1 k 0.5", "1 k-on 0.5", "line 2: parameter 'k-on' is not a name"),
        ("1 k 0.5", "1 k log(2)", "write ln or log10"),
        ("1 k 0.5", "1 k __import__(2)", "line 2: unknown function '__import__'"),
        ("1 k 0.5", f"1 k {'(' * 60}1{')' * 59}", "line 2: cannot read .* this bracket is never closed"),
        ("1 k 0.5", "1 k -1", "line 9: the rate 'k' comes to -1; it must not be negative"),
        ("1 A() 10", "1 A() -3", r"line 5: -3 copies of 'A\(\)'"),
        ("1 A() 10", "1 A() 1e30", r"line 5: 1e\+30 copies of 'A\(\)'; expected a count from 0"),
        ("1 A() 10", "7 A() 10", "line 5: species number 7 came; expected 1"),
        ("2 B() 0", "2 A() 0", r"line 6: species 'A\(\)' comes twice"),
        ("1,1 2 k", "1,3 2 k", "line 9: species 3; the file has 1 to 2"),
        ("1,1 2 k", "1,x 2 k", "line 9: a reaction is `number reactants products rate`"),
        ("1,1 2 k", "1,1 2", "line 9: a reaction is"),
        ("1,1 2 k", "1,99999999999999999999 2 k", "line 9: a reaction is"),
        ("1,1 2 k", "1,1 2 ..*k", "line 9: cannot read .* means nothing at column 1"),
        ("1 both 1,2*2", "1 1,2*2", "line 12: the group '1,2.2' comes twice, or is no name"),
        ("1,1 2 k", "1,1 2 q", "line 9: 'q' is not known here"),
        ("1,1 2 k", "1,1 2 Sat k", "line 9: Sat takes 2 to 3 numbers"),
        ("1 both 1,2*2", "1 both 1,2*9", r"line 12: '2\*9' is not one of the species 1 to 2"),
        ("end species", "end things", "line 7: 'end things', but the block 'species' of line 4 has no end yet"),
        ("end species\n", "", "'begin reactions', but the block 'species' of line 4"),
        ("begin groups", "begin species", "line 11: the block 'species' comes twice"),
        ("begin groups", "begin rules", "line 11: the block 'rules' is not one of"),
        ("end groups\n", "", "the block 'groups' of line 11 has no end yet; the file may be truncated"),
        (
            "begin parameters",
            'setConcentration("A()", 3)\nbegin parameters',
            "line 1: .* outside any block is not read",
        ),
        (GOOD, "", "has no block 'species'; is it a .net file"),
        (GOOD, GOOD.replace("1,1 2 k", "1 2 f") + "begin functions\n1 f() g()\nend functions", "'g' is not known here"),
    ],
)
def test_mistakes_are_named_with_their_line(old, new, message, tmp_path):
    assert old in GOOD
    with pytest.raises(ValueError, match=message):
        read(written(tmp_path, GOOD.replace(old, new, 1)))


def test_other_bad_files(tmp_path):
    with pytest.raises(ValueError, match="does not exist"):
        read(tmp_path / "none.net")
    path = tmp_path / "bytes.net"
    path.write_bytes(b"begin species\n\xff\xfe")
    with pytest.raises(ValueError, match="not UTF-8"):
        read(path)
    assert ".net" in SUFFIXES


def test_fractions_of_a_copy_ask_for_a_scale(tmp_path):
    path = written(tmp_path, GOOD.replace("A() 10", "A() 6.022").replace("B() 0", "B() 0.7"))
    with pytest.raises(ValueError, match=r"'A' starts from 6.022 and so do 1 more, .* --copies-per-unit"):
        read(path)
    assert_array_equal(read(path, 1000).initial, [6022, 700])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-2^2", -4),
        ("2^3^2", 512),
        ("ln(_e)", 1),
        ("log10(100)", 2),
        ("rint(2.6)", 3),
        ("if(1>2,3,4)", 4),
        ("1e-3", 1e-3),
    ],
)
def test_formulas_come_to_numbers(text, expected):
    assert number(text, {}) == pytest.approx(expected, rel=1e-15)


def test_predict_takes_a_file(tmp_path):
    """Immigration and death: a Poisson count at any time."""
    path = written(
        tmp_path,
        "begin species\n1 X(a,b~0) 0\nend species\nbegin reactions\n1 0 1 2*1\n2 1 0 0.1\nend reactions\n",
    )
    run = CliRunner().invoke
    options = ["predict", str(path), "--times", "5", "--method", "fsp", "--json"]
    done = run(main, options)
    assert done.exit_code == 0, done.output
    data = json.loads(done.output)
    assert data["species"] == ["X(a,b~0)"]
    assert data["convention"]["combinations"] == "ordered"
    mean = 20 * -math.expm1(-0.5)
    assert_allclose([data["mean"][0][0], data["sd"][0][0] ** 2], mean, rtol=1e-9)
    data = json.loads(run(main, [*options, "--initial", "X(a,b~0)=7"]).output)
    assert_allclose(data["mean"][0][0], mean + 7 * math.exp(-0.5), rtol=1e-9)
    for extra, why in ((["--cubes", "3"], "has no cubes"), (["--rates", "table3"], "are for another network")):
        done = run(main, [*options, *extra])
        assert done.exit_code == 2
        assert why in done.output


def test_what_is_shown(tmp_path):
    """Observables and chosen species, sampled and solved, are sums of the same runs and states."""
    path = written(tmp_path, GOOD)
    run = CliRunner().invoke
    options = ["predict", str(path), "--times", "0.05", "--times", "0.3", "--json"]
    for method in ("auto", "transient"):
        both, every = (
            json.loads(run(main, [*options, "--method", method, *chosen]).output)
            for chosen in (["--show", "both", "--show", "B"], [])
        )
        assert both["species"] == ["both", "B"]
        assert every["species"] == ["A", "B", "both"]
        assert_allclose([row[2] for row in every["mean"]], 10, rtol=1e-12)
        assert_allclose([row[0] for row in both["mean"]], 10, rtol=1e-12)  # A + 2 B is kept
        assert_allclose([row[0] for row in both["sd"]], 0, atol=1e-6)
        for key in ("mean", "sd"):
            assert_allclose([row[1] for row in both[key]], [row[1] for row in every[key]], rtol=1e-9)
    done = run(main, [*options, "--show", "boht"])
    assert done.exit_code == 2
    assert "neither a species nor an observable; did you mean both?" in done.output


def test_large_networks_show_their_observables(tmp_path):
    lines = [f"{i} S{i}() {i}" for i in range(1, 41)]
    text = "begin species\n" + "\n".join(lines) + "\nend species\nbegin reactions\n1 1 2 1\nend reactions\n"
    run = CliRunner().invoke
    path = str(written(tmp_path, text))
    done = run(main, ["predict", path, "--times", "1"])
    assert done.exit_code == 2
    assert "40 species and no observable that is a whole sum; name those to be shown" in done.output
    path = str(written(tmp_path, text + "begin groups\n1 half 0.5*3\nend groups\n"))
    done = run(main, ["predict", path, "--times", "1", "--show", "half"])
    assert done.exit_code == 2
    assert "'half' counts 'S3' 0.5 times; expected a whole number >= 0" in done.output
    path = str(written(tmp_path, text + "begin groups\n1 last 40,2*39\nend groups\n"))
    data = json.loads(run(main, ["predict", path, "--times", "1", "--json", "--runs", "5"]).output)
    assert data["species"] == ["last"]
    assert data["mean"] == [[118.0]]


@pytest.mark.parametrize("kind", [kind for kind in FORMATS if kind.is_written], ids=lambda kind: kind.name)
def test_derive_writes_for_other_programs(kind, tmp_path):
    """The book's exact prediction, and that of the file it was written to, are the same."""
    run = CliRunner().invoke
    path = str(tmp_path / f"line{kind.suffixes[0]}")
    start = ["line4", "--rates", "table3", "--cubes", "20"]
    done = run(main, ["rules", "derive", *start, "--out", path])
    assert done.exit_code == 0, done.output
    assert "4 species and 8 channels" in done.output
    asked = ["--times", "100", "--method", "transient", "--json"]
    of_book, of_file = (json.loads(run(main, ["predict", *each, *asked]).output) for each in (start, [path]))
    assert of_file["species"] == of_book["species"]
    assert_allclose(of_file["mean"], of_book["mean"], rtol=1e-10)
    shown = json.loads(run(main, ["rules", "derive", path, "--json"]).output)
    assert [row["name"] for row in shown["channels"]][:1] == [["1+1->2"], ["_1_1__2"]][kind.name == "sbml"]
    other = str(tmp_path / "again.net")
    assert run(main, ["rules", "derive", path, "--out", other]).exit_code == 0
    assert_array_equal(read(other).initial, [20, 0, 0, 0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--out", "x.net"], "a rule book has no rates"),
        (["--out", "x.csv", "--rates", "table3", "--cubes", "2"], "its name must end in .net"),
        (["--out", "none/x.net"], "the folder of none/x.net does not exist"),
    ],
)
def test_what_derive_cannot_write(arguments, message):
    done = CliRunner().invoke(main, ["rules", "derive", "line4", *arguments])
    assert done.exit_code == 2
    assert message in done.output


NAMED = """begin parameters
1 kon 0.5
2 koff 2*kon
3 K 7
4 A 3
5 N 4*A
end parameters
begin functions
1 f() kon*total/(K + total)
end functions
begin species
1 A() N
2 B() 10
3 $C() K
end species
begin reactions
1 1,2 3 kon
2 3 1,2 0.5*koff
3 1,1 2 3 * kon + A
4 1 2 f
5 1 2 Sat kon K
6 0 1 5
end reactions
begin groups
1 total 1,2*2
end groups
"""


def test_parameters_keep_their_names(tmp_path):
    """Other values mean what they mean written into the file; `A`, also a species, stays a number, as do others."""
    path = tmp_path / "model.net"
    path.write_text(NAMED)
    model = read(path)
    assert model.network.parameters == {"kon": 0.5, "koff": 1.0, "K": 7.0, "N": 12.0}
    assert "0.5  kon = 0.5" not in str(model.network)
    assert "koff = 1" in str(model.network)
    states = np.random.default_rng(0).integers(2, 20, (20, 3))
    chosen = model.with_parameters(kon=0.25, K=9)
    path.write_text(NAMED.replace("kon 0.5", "kon 0.25").replace("K 7", "K 9"))
    again = read(path)
    assert_array_equal(chosen.initial, again.initial)
    assert_array_equal(chosen.network.propensities(states), again.network.propensities(states))
    assert not np.any(np.all(chosen.network.propensities(states) == model.network.propensities(states), axis=1))
    assert chosen.with_parameters(N=5).initial.tolist() == [5, 10, 9]
    with pytest.raises(ValueError, match="'A' is a species; counts at time 0 are given by initial"):
        model.with_parameters(A=5)
    path.write_text(NAMED.replace("2*2\n", "K*2\n"))  # a weight is a number; so are then all
    assert read(path).network.parameters == {}
