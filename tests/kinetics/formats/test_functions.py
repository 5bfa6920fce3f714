"""Functions that rate laws have no operation for, in .net files and in SBML; and Sat with several constants."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sbml_builder import Builder

from kinetics.formats import read
from kinetics.formats.formulas import number
from kinetics.formats.functions import MADE_OF_OTHERS

VALUES = {"acosh": (1.0, 1.5, 1e9), "atanh": (-0.99, 0.0, 0.6), "coth": (-3.0, 0.5), "csch": (-3.0, 0.5)}
EXACT = {
    **{name: getattr(math, name) for name in ("tan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh")},
    "cot": lambda x: 1 / math.tan(x), "sec": lambda x: 1 / math.cos(x), "csc": lambda x: 1 / math.sin(x),
    "coth": lambda x: 1 / math.tanh(x), "sech": lambda x: 1 / math.cosh(x), "csch": lambda x: 1 / math.sinh(x),
    "sign": np.sign,
}  # fmt: skip
SBML = {name: f"arc{name[1:]}" if name.startswith("a") else name for name in EXACT if name != "sign"}


@pytest.mark.parametrize("name", MADE_OF_OTHERS)
def test_they_are_what_they_are_called(name):
    for x in VALUES.get(name, (-20.0, -1.3, 0.4, 3.0, 20.0)):
        assert_allclose(number(f"{name}({x})", {}), EXACT[name](x), rtol=1e-13, atol=1e-15)


def test_beyond_the_range_of_exp():
    assert [number(f"tanh({x})", {}) for x in (-800, 800)] == [-1.0, 1.0]
    assert_allclose(number("asinh(-1e150)", {}), math.asinh(-1e150), rtol=1e-14)


@pytest.mark.parametrize("name", SBML)
def test_they_are_read_from_sbml(name, tmp_path):
    made = Builder()
    made.species("A", 3)
    made.reaction("out", {"A": 1}, {}, f"A * (20 + {SBML[name]}({0.5 if name == 'atanh' else 1.5}))")
    expected = 3 * (20 + EXACT[name](0.5 if name == "atanh" else 1.5))
    assert_allclose(made.read(tmp_path).network.propensities([3]), [expected], rtol=1e-14)


def test_others_of_muparsers_list():
    assert number("sum(1, 2, 3.5)", {}) == 6.5
    assert number("avg(1, 2, 6)", {}) == 3.0
    assert number("rint(2.5) + min(3, 1, 2) + max(4, 5)", {}) == 9.0
    for name in ("asin(1)", "acos(1)", "atan(1)", "atan2(1, 2)", "mratio(1, 2, 3)"):
        with pytest.raises(ValueError, match=rf"the function '{name.partition('(')[0]}' is not read here"):
            number(name, {})


def sat(tmp_path, rate, reactants="1,2"):
    path = tmp_path / "sat.net"
    path.write_text(
        "begin parameters\n1 k 3\n2 K1 7\n3 K2 5\nend parameters\n"
        "begin species\n1 A() 10\n2 B() 4\n3 C() 2\nend species\n"
        f"begin reactions\n1 {reactants} 2 {rate}\nend reactions\n",
        encoding="utf-8",
    )
    return read(path).network.propensities([10, 4, 2])


def test_saturation_has_a_constant_for_each_of_the_first_reactants(tmp_path):
    a, b, c = 10, 4, 2
    assert_allclose(sat(tmp_path, "Sat k K1"), [3 * a * b / (7 + a)])
    assert_allclose(sat(tmp_path, "Sat k K1 K2"), [3 * a * b / ((7 + a) * (5 + b))])
    assert_allclose(sat(tmp_path, "2*Sat k K1 K2", "1,2,3"), [2 * 3 * a * b * c / ((7 + a) * (5 + b))])
    for rate, reactants, fault in (
        ("Sat k K1 K2", "1", "Sat takes 2 numbers and at least 1 reactants; 3 and 1 came"),
        ("Sat k K1 K2 K1", "1,2", "Sat takes 2 to 3 numbers"),
        ("Sat k K1 K2", "1,1", "takes reactants that differ"),
        ("Hill k K1 K2 K1", "1,2", "Hill takes 3 numbers"),
    ):
        with pytest.raises(ValueError, match=rf"sat\.net, line 12: .*{fault}"):
            sat(tmp_path, rate, reactants)
