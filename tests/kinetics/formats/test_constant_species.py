"""Species that nothing changes: numbers where no count can be what they are, and species as ever where one can."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sbml_builder import Builder

from kinetics.formats import read
from kinetics.markov.transient import FiniteStateProjection

NET = """begin parameters
1 k 3
2 x0 0.5
end parameters
begin species
1 A() 10
2 B() 4
3 $E() 0.25
4 F() x0
end species
begin functions
1 f() 2*G
end functions
begin reactions
1 1,3 2,3 k
2 2,4 1,4 0.5*k
3 2 1 f()
4 2,3 1,3 Sat k x0
5 3 1,3 2
end reactions
begin groups
1 G 1,3
2 H 1,2*2
end groups
"""
NOTE = "nothing changes {}; its value, {:g} in the file, is read as a number, not a count"


def fed(**species):
    """Xo -> S1 at .2 Xo, S1 -> nothing at .3 S1."""
    made = Builder()
    made.species("Xo", **{"amount": 2.5, **species})
    made.species("S1", 3)
    made.parameter("k1", 0.2)
    made.reaction("J1", {"Xo": 1}, {"S1": 1}, "k1 * Xo")
    made.reaction("J2", {"S1": 1}, {}, "0.3 * S1")
    return made


@pytest.mark.parametrize("held", [{"boundary": True, "constant": True}, {"boundary": True}])
def test_a_feed_that_nothing_changes_is_a_number(held, tmp_path):
    model = fed(**held).read(tmp_path)
    assert model.network.species == ("S1",)
    assert model.notes == (NOTE.format("Xo", 2.5),)
    mean = 2.5 * 0.2 / 0.3 + (3 - 2.5 * 0.2 / 0.3) * math.exp(-0.3 * 1)
    found = FiniteStateProjection(1e-11).solve(model.network, model.initial, [1.0]).mean()[0]
    assert_allclose(found, [mean], rtol=1e-9)  # 2.6544
    assert_allclose(model.with_parameters(Xo=5.0).network.propensities([3]), [1.0, 0.9])
    assert model.formulas["Xo"] == "2.5"


def test_a_whole_amount_stays_a_species_and_a_scale_makes_others_whole(tmp_path):
    whole = fed(amount=2, boundary=True).read(tmp_path)
    assert whole.network.species == ("Xo", "S1")
    assert whole.notes == ()
    scaled = fed(boundary=True).read(tmp_path, 2)
    assert_array_equal(scaled.initial, [5, 6])
    assert_allclose(scaled.network.propensities([5, 6]), [2 * 0.2 * 2.5, 0.3 * 6])
    model = fed(boundary=True).read(tmp_path, 3)  # 7.5 copies
    assert model.network.species == ("S1",)
    assert_allclose(model.network.propensities([9]), [3 * 0.2 * 2.5, 0.3 * 9])


def test_what_anything_changes_is_a_count(tmp_path):
    """By a reaction, or an event; a rule gives what is neither."""
    with pytest.raises(ValueError, match=r"'Xo' starts from 2.5, which is not a whole number"):
        fed().read(tmp_path)
    made = fed(boundary=True)
    made.event("refill", "time > 3", Xo="7")
    with pytest.raises(ValueError, match=r"'Xo' starts from 2.5, which is not a whole number"):
        made.read(tmp_path)
    made = fed(boundary=True)
    made.rule("Xo", "S1 / 2")
    assert made.read(tmp_path).network.species == ("S1",)
    assert made.read(tmp_path).notes == ()


def test_enzymes_that_come_back_and_bystanders_are_numbers(tmp_path):
    """A concentration in a volume of 4 as well, which laws read as what it is."""
    made = Builder(size=4.0)
    made.species("S", 8)
    made.species("E", 0.5)
    made.species("C", concentration=0.3, by_amount=False)
    made.reaction("turn", {"S": 1, "E": 1}, {"E": 1}, "2 * S * E * C")
    model = made.read(tmp_path)
    assert model.network.species == ("S",)
    assert_allclose(model.network.propensities([8]), [2 * 8 * 0.5 * 0.3])
    assert model.notes == (NOTE.format("E", 0.5), NOTE.format("C", 1.2))
    made.reaction("lost", {"E": 2}, {"E": 1}, "E")
    with pytest.raises(ValueError, match=r"'E' starts from 0.5"):
        made.read(tmp_path)


def test_fixed_species_of_a_net_file(tmp_path):
    path = tmp_path / "half.net"
    path.write_text(NET, encoding="utf-8")
    model = read(path)
    assert model.network.species == ("A", "B")
    assert model.notes == (NOTE.format("E", 0.25), NOTE.format("F", 0.5), "G is not a sum of counts and is not shown")
    assert model.observables == {"H": {"A": 1.0, "B": 2.0}}

    def expected(a, b, e=0.25, x=0.5):
        return [3 * a * e, 1.5 * b * x, 2 * (a + e) * b, 3 / (x + b) * b * e, 2 * e]

    assert_allclose(model.network.propensities([10, 4]), expected(10, 4), rtol=1e-14)
    other = model.with_parameters(E=7.0, x0=0.75)
    assert_allclose(other.network.propensities([10, 4]), expected(10, 4, 7.0, 0.75), rtol=1e-14)
    path.write_text(NET.replace("1 1,3 2,3 k", "1 1,3,3 2,3,3 k"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"half\.net, line 15: two of 'E', which starts from 0.25: no count"):
        read(path)
    path.write_text(NET.replace("$E() 0.25", "$E() 1").replace("x0 0.5", "x0 2"), encoding="utf-8")
    assert read(path).network.species == ("A", "B", "E", "F")


def test_a_net_file_takes_a_scale_with_them(tmp_path):
    path = tmp_path / "half.net"
    path.write_text(NET, encoding="utf-8")
    model = read(path, 2)
    assert model.network.species == ("A", "B", "F")  # .5 is one copy; .25 is none
    assert_allclose(
        model.network.propensities([20, 8, 1]),
        2 * np.array([3 * 10 * 0.25, 1.5 * 4 * 0.5, 2 * 10.25 * 4, 3 / 4.5 * 4 * 0.25, 0.5]),
        rtol=1e-14,
    )
