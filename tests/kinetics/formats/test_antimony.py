"""Antimony files, beside the same models written by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Network
from kinetics.formats import read
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


def test_a_model_that_takes_too_much_is_refused(tmp_path):
    """Programs are stopped by their processor time and their memory; the control is not."""
    import sys

    def program(act, seconds=1, memory=2**30):
        return Program("X", (sys.executable, "-c", act), seconds, memory, "take less")

    path = tmp_path / "m.ant"
    kept = "open('b', 'w').write(open('a').read())"
    assert program(kept).translated(path, "text", "a", "b") == "text"
    with pytest.raises(ValueError, match=r"m\.ant: X took more than 1 s of .*, or 10 s by the clock; take less"):
        program("while True: pass").translated(path, "", "a", "b")
    with pytest.raises(ValueError, match=r"m\.ant: X refused it: .*MemoryError"):
        program("x = bytes(2 ** 31)").translated(path, "", "a", "b")
    with pytest.raises(ValueError, match=r"m\.ant: X refused it: code 0"):
        program("pass").translated(path, "", "a", "b")
