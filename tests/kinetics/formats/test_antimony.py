"""Antimony files, beside the same models written by hand."""

import ast
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Network
from kinetics.formats import read
from kinetics.formats.antimony import plain_text
from kinetics.formats.outside import Program
from kinetics.formats.sbml import Sbml

pytest.importorskip("antimony")

MODEL = """
model feedback
  species A, B
  A = 10; B = 4; k1 = 0.1; k2 = 0.05; K = 5
  make: -> A; 100 * k2
  pair: 2 A -> B; k1 * A * (A - 1) / 2
  out: B -> ; k2 * B / (K + B)
end
"""
LINES = """
make: 0 -> A, 100 * k2
pair: 2 A -> B, k1
out: B -> 0, k2 * B / (K + B)
A = 10
B = 4
K = 5
"""


@pytest.fixture
def model(tmp_path):
    def of_text(text):
        path = tmp_path / "model.ant"
        path.write_text(text, encoding="utf-8")
        return read(path)

    return of_text


def test_it_is_the_network_written_by_hand(model):
    got, network = model(MODEL), Network.from_text(LINES, k1=0.1, k2=0.05)
    assert got.network.species == network.species
    assert_array_equal(got.initial, [10, 4])
    states = np.random.default_rng(1).integers(0, 30, (40, 2))
    assert_allclose(got.network.propensities(states), network.propensities(states), rtol=1e-14)
    other = got.with_parameters(k2=0.5)
    assert_allclose(
        other.network.propensities(states), network.with_parameters(k2=0.5).propensities(states), rtol=1e-14
    )


def test_amounts_are_those_of_its_sbml(model, tmp_path):
    """A concentration in a compartment of size 2, by the library in this process and by ours in its own."""
    import antimony

    text = "model m\n compartment C = 2; species A in C, B in C\n A = 10; k = 0.1\n r: A -> B; C * k * A\n B = 0\nend\n"
    assert antimony.loadAntimonyString(text) >= 0
    (tmp_path / "same.xml").write_text(antimony.getSBMLString("m"), encoding="utf-8")
    got, expected = model(text), Sbml().read(tmp_path / "same.xml")
    assert got.initial.tolist() == expected.initial.tolist() == [20, 0]
    assert got.network.fingerprint == expected.network.fingerprint
    assert model(text.replace("B = 0", "")).initial.tolist() == [20, 0]


def test_events_act(model):
    got = model(MODEL.replace("end", "  at B > 5: A = 3\nend"))
    assert len(got.network.events) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MODEL.replace("-> A;", "=< A;"), "Antimony refused it.*line 5"),
        (MODEL.replace("K = 5", "L = 5"), r"model\.ant \(as SBML\), line \d+: 'K' in a formula"),  # the line is SBML's
        ('import "/etc/hostname"\n' + MODEL, "imports another file"),
        (MODEL.replace("2 A -> B", "2 A => B"), None),
    ],
)
def test_slips_are_told_by_name(model, text, said):
    if said is None:  # irreversible, which is how every channel is meant here
        assert len(model(text).network.channels) == 3
        return
    with pytest.raises(ValueError, match=said) as refused:
        model(text)
    assert "model.ant" in str(refused.value)


def test_programs_see_nothing_of_the_user(tmp_path, monkeypatch):
    """Neither the environment, but for what Python is found by, nor the folder, nor standard input."""
    monkeypatch.setenv("TOKEN", "secret")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").write_text("secret", encoding="utf-8")
    act = "import os, sys; open('b', 'w').write(repr([sorted(os.environ), os.listdir(), sys.stdin.read()]))"
    program = Program("X", (sys.executable, "-c", act), 10, 2**30, "")
    names, files, typed = ast.literal_eval(program.translated(tmp_path / "m", {"a": ""}, "b"))
    assert set(names) <= {
        "HOME",
        "LC_ALL",
        "PATH",
        "PYTHONPATH",
        "PYTHONSAFEPATH",
        "TMPDIR",
        "LD_LIBRARY_PATH",
        "LC_CTYPE",
    }
    assert (set(files), typed) == ({"a", "b"}, "")


REFUSED = [
    'import "x"',
    'import /* y */ "x"',
    'import \\\n "x"',
    'k = 1; import "x"',
    'model import "x"',
    'Import\n"x"',
    '1import "x"',
    '2.5e3import "x"',
    'A -oimport "x"',
    "import ```x```",
    "k.import = 3",
    'A is "a\\" import "b"',
    'A is "a',
    "A notes ```a",
    "/* a",
    "k = 1 \\+ 2",
    "k = \u00b5",
    "k = 1\u2028import",
    "k = `1`",
    "// a \0",
    "k = 1 \x0c",
    "\x85",
]


@pytest.mark.parametrize("text", REFUSED)
def test_what_opens_a_file_or_is_in_doubt_is_refused(text):
    with pytest.raises(ValueError, match=r"^m, line [12]: |^m: the control character"):
        plain_text(Path("m"), text)


def test_ends_of_lines_are_those_of_any_system():
    text = "A -> B # x\nk = 1 \\\n + 2\n"
    for end in ("\r\n", "\r"):
        assert plain_text(Path("m"), text.replace("\n", end)) == plain_text(Path("m"), text)


# One line or more for every part of the language.
FEATURES = """
S1 -> S2; k*S1 // a comment, import "x"
J0: S1 + 2 S2 -> $X; k*S1 /* of two
lines */
J1: S1 => ; k \\
 * S1 # and another
J2: S1 -> S2; vmax*S1; vmax = 3

k := 2*S1; z = 3
z' = k * 2
E1: at S1 > 5 && z <= 3: S1 = 3, z = 2
at 2 after (S1 > 5), t0=false, priority=1, persistent=true: S1=4
S1 is "the µ-species \\x"; S1 has mole_per
unit mole_per = 1e3 item / second
compartment c = 2.5; species S4 in c, $S5 in c; S6 in c
S4 = 3; S5 = .5e-1; S6 = 2E1 ; S6 has substance
S1 identity "http://identifiers.org/chebi/CHEBI:1",
 "http://identifiers.org/chebi/CHEBI:2"
S1.sboTerm = SBO:00000004; S1.sboTerm = 4
S1 notes ```some
"import" notes```
const p = 2; var q = 3 ml; q2 = p^2 % 3
2E -> S1; k1-oxy
S1 -o S2; k
Import: S1 -> S2; z; import_rate = z
constraint: S1 > 3
r = piecewise(1, S1 < 2, !(S1 == 3) || S1 != 4, 5)
DNA d; gene g; operator o; d: o--g
e: o--g--o2; S1 -> S2; e
S1 = a + b; a = 1; b = exp(2)
S1 created "2020-01-01T00:00:00Z"
-5 < S1
"""


def split():
    """The features one by one: a line and those that it goes on in."""
    found = []
    for line in FEATURES.split("\n"):
        goes_on = found and found[-1].count("/*") > found[-1].count("*/")
        if found and (goes_on or found[-1].endswith((",", "\\")) or found[-1].count("```") % 2):
            found[-1] += "\n" + line
        elif line:
            found.append(line)
    return found


def test_what_is_written_anew_means_the_same():
    """By the library itself: the same SBML, or the same refusal, for every feature, alone and with one more."""
    import antimony

    def sbml(text):
        antimony.clearPreviousLoads()
        if antimony.loadAntimonyString(text) < 0:
            return "refused"
        return antimony.getSBMLString(antimony.getMainModuleName())

    parts = split()
    texts = [
        "function f(x, y)\n x + y\nend\nmodel A(x)\n S -> T; f(x, 2)\nend\nmodel *B()\n a: A(3);\n a.S is S1;\nend\n"
    ]
    for i, part in enumerate(parts):
        for other in ("", parts[i - 1]):
            texts += [f"model *m()\n S1 = 3; k = 2; z = 1\n {part}\n {other}\nend\n", f"{part}\n{other}"]
    found = [sbml(text) for text in texts]
    assert [sbml(plain_text(Path("m"), text)) for text in texts] == found
    assert found.count("refused") < len(found) / 3
    assert sbml("S1 -> S2; 2*S1") != sbml("S1 -> S2; 3*S1")  # the control


def test_a_model_that_takes_too_much_is_refused(tmp_path):
    """Programs are stopped by their processor time and their memory; the control is not."""

    def program(act, seconds=1, memory=2**30):
        return Program("X", (sys.executable, "-c", act), seconds, memory, "take less")

    path = tmp_path / "m.ant"
    kept = "open('b', 'w').write(open('a').read())"
    assert program(kept).translated(path, {"a": "text"}, "b") == "text"
    with pytest.raises(ValueError, match=r"m\.ant: X took more than 1 s of .*, or 10 s by the clock; take less"):
        program("while True: pass").translated(path, {}, "b")
    with pytest.raises(ValueError, match=r"m\.ant: X refused it: .*MemoryError"):
        program("x = bytes(2 ** 31)").translated(path, {}, "b")
    with pytest.raises(ValueError, match=r"m\.ant: X stopped before it came to an end; take less"):
        replace(program("print('Round 9'); " + kept), stopped=b"Round 9").translated(path, {"a": ""}, "b")
    with pytest.raises(ValueError, match=r"m\.ant: X refused it: code 0"):
        program("pass").translated(path, {}, "b")
