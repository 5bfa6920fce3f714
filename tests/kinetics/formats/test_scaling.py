"""The scale of a file: fractions of a copy ask for it, and the rate equations stay what they are."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rate_equations import RateEquations
from sbml_builder import Builder

from kinetics.formats import read

pytest.importorskip("libsbml")
TIMES = np.array([0.0, 0.5, 1.0, 2.0, 3.5])


def test_copies_per_unit_keep_the_rate_equations(tmp_path):
    """A pair reaction, a law, an event and a sum, from fractions; the noise is that of so many copies."""
    made = Builder(size=2.0)
    made.species("A", concentration=0.375, by_amount=False)
    made.species("B", 0.5)
    made.species("total", None, boundary=True)
    made.rule("total", "2*A*cell + B")
    made.reaction("pair", {"A": 1, "B": 1}, {"A": 1}, "3*A*B")
    made.reaction("use", {"A": 1}, {}, "A/(0.1 + A)")
    made.event("dose", "B < 0.25", B="B + 0.125")
    with pytest.raises(ValueError, match=r"'A' starts from 0\.75 and so do 1 more"):
        made.read(tmp_path)
    small, large = made.read(tmp_path, 8), made.read(tmp_path, 8e6)
    assert_array_equal(small.initial, [6, 4])
    assert small.observables == {"total": {"A": 2.0, "B": 1.0}}
    assert "one unit of the file's amounts is 8 copies" in small.notes
    found = [
        RateEquations(each.network).solution(each.initial, TIMES) / scale for each, scale in ((small, 8), (large, 8e6))
    ]
    assert_allclose(*found, rtol=1e-6)
    assert np.ptp(found[0][:, 1]) > 0.2
    for scale in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match=r"copies per unit; expected a finite number above 0"):
            made.read(tmp_path, scale)


def test_an_amount_that_vanishes_is_told(tmp_path):
    made = Builder()
    made.species("A", 1)
    made.species("B", 1.5e-15)
    made.reaction("fade", {"B": 1}, {}, "B")
    with pytest.raises(ValueError, match=r"'B' starts from 1\.5e-15"):
        made.read(tmp_path)
    assert "rounded 1.5e-12 copies of B" in made.read(tmp_path, 1e3).notes


def test_a_bionetgen_file_takes_a_scale(tmp_path):
    """Rate constants of order n are divided by scale**(n - 1); a function of like reactants has no scale."""
    text = (
        "begin parameters\n1 k 3\nend parameters\nbegin species\n1 A() 0.5\n2 B() 1.25\nend species\n"
        "begin functions\n1 f() k*both\nend functions\n"
        "begin reactions\n1 1,2 2 k\n2 0 1 2*k\n3 2,2 1 0.5*k\n4 1 2 f\nend reactions\n"
        "begin groups\n1 both 1,2\nend groups\n"
    )
    path = tmp_path / "model.net"
    path.write_text(text, encoding="utf-8")
    model = read(path, 8)
    assert_array_equal(model.initial, [4, 10])
    assert_allclose(model.network.propensities([4, 10]), [3 / 8 * 40, 6 * 8, 1.5 / 8 * 90, 3 * 14 * 4 / 8], rtol=1e-14)
    path.write_text(text.replace("4 1 2 f", "4 2,2 1 f"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"line 15: a function times like reactants, .* has no scale"):
        read(path, 8)
