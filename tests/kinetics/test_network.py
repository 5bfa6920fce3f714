from math import comb, perm

import numpy as np
import pytest
from known_systems import bare_line, decay, line, network
from numpy.testing import assert_allclose, assert_array_equal

from kinetics.network import Network

ONE = {"species": ("A", "B"), "channels": ("r",), "reactants": [[2, 1]], "stoichiometry": [[-1, 1]], "ways": [3]}


@pytest.mark.parametrize(
    ("combinations", "count"),
    [("distinct", comb), ("ordered", perm), ("product", lambda s, m: s**m if s >= m else 0)],
)
def test_combinations_of_any_order(combinations, count):
    reactions = {"a": ((0, 0), (1, 0)), "b": ((1, 0), (0, 0)), "c": ((2, 1), (0, 0)), "d": ((4, 3), (0, 0))}
    net = network(("A", "B"), reactions, [1, 1, 1, 1], combinations)
    states = [(a, b) for a in range(8) for b in range(6)]
    expected = [[count(a, m) * count(b, n) for m, n in ((0, 0), (1, 0), (2, 1), (4, 3))] for a, b in states]
    assert_array_equal(net.combinations_of(states), expected)
    assert_array_equal(net.combinations_of(np.reshape(states, (8, 6, 2))).reshape(48, 4), expected)


def test_propensity_is_rate_times_ways_times_combinations():
    net = line("table3_geometric")
    expected = [7.88e-5 * 4 * 45, 9.29e-5 * 4 * 30, 5.32e-5 * 4 * 50, 6.29e-5 * 4 * 3, 4.53e-5 * 3]
    expected += [3.89e-5 * 2 * 5, 0.77e-5 * 2 * 2, 1.2e-5 * 2]
    assert_allclose(net.propensities([10, 3, 5, 2]), expected, rtol=1e-14)


def test_large_counts_do_not_overflow():
    pair = network(("A",), {"pair": ((2,), (0,))}, [1.0])
    assert_allclose(pair.propensities([10**15]), [5e29], rtol=1e-14)


def test_no_channels():
    net = Network(("A",), (), [], [], [], [])
    assert net.propensities([5]).shape == (0,)
    assert "0 channels" in str(net)


def test_rates_missing():
    with pytest.raises(ValueError, match="no rate constants yet; give it some"):
        bare_line().propensities([1, 0, 0, 0])
    assert bare_line().with_rates(np.ones(8)).propensities([0, 0, 0, 1])[7] == 1.0


def test_arrays_are_copied_and_closed():
    rates = np.ones(8)
    net = bare_line().with_rates(rates)
    rates[0] = 5.0
    assert net.rate_constants[0] == 1.0
    for array in (net.rate_constants, net.ways, net.reactants, net.stoichiometry, net.conserved["cubes"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2


def test_fingerprint_tells_networks_apart_and_not_rates():
    assert line("table3").fingerprint == line("table3_literal").fingerprint == bare_line().fingerprint
    assert decay().fingerprint != bare_line().fingerprint
    assert len(decay().fingerprint) == 64


def test_tables():
    text = str(line())
    assert "4 species, 8 channels; distinct combinations; conserved: cubes" in text
    assert "1+2->3   monomer + dimer -> trimer    2  9.29e-05" in text
    assert "k (1/tu)" not in str(bare_line())
    assert "<td>2 monomer -&gt; dimer</td>" in line()._repr_html_()
    assert "decay    X -> 0" in str(decay())


def test_state_by_name_or_position():
    net = bare_line()
    assert_array_equal(net.state({"monomer": 20, "trimer": 3}), [20, 0, 3, 0])
    assert_array_equal(net.state([1, 2.0, 3, 4]), [1, 2, 3, 4])
    assert_array_equal(net.state([5_000_000_000, 0, 0, 10**15]), [5_000_000_000, 0, 0, 10**15])


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        ({"pentamer": 1}, "unknown species 'pentamer'; the network has monomer, dimer"),
        ([1, 2, 3], r"state has shape \(3,\); expected \(4\)"),
        ([1, 2, 3, -4], "state holds -4; expected at least 0"),
        ([1, 2, 3, 0.5], "state must be whole numbers; 0.5 is not one"),
        ([1, 2, 3, np.nan], "state must be whole numbers; nan is not one"),
        ([1, 2, 3, np.inf], "whole numbers"),
        ([1, 2, 3, 2**63], "the largest count is"),
        ([1, 2, 3, 1e19], "the largest count is"),
        (["a", "b", "c", "d"], "state must be numbers"),
        ([[1, 2], [3]], "state is not an array of numbers"),
    ],
)
def test_bad_states(counts, message):
    with pytest.raises(ValueError, match=message):
        bare_line().state(counts)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"species": ("A", "A")}, "species has 'A' twice"),
        ({"species": "AB"}, "expected a sequence of names"),
        ({"species": ()}, "at least one species"),
        ({"channels": ("",)}, "non-empty names"),
        ({"reactants": [[2, 1], [1, 0]]}, r"reactants has shape \(2, 2\); expected \(1, 2\)"),
        ({"reactants": [[2, -1]]}, "reactants holds -1; expected at least 0"),
        ({"reactants": [[0.5, 1]]}, "reactants must be whole numbers; 0.5 is not one"),
        ({"stoichiometry": [[-3, 1]]}, "takes 3 of 'A' but needs only 2; raise its reactants"),
        ({"ways": [-1]}, "ways holds -1.0; expected at least 0"),
        ({"ways": [1, 2]}, "ways has shape"),
        ({"rate_constants": [np.nan]}, "rate_constants holds nan; expected finite"),
        ({"rate_constants": [np.inf]}, "rate_constants holds inf"),
        ({"rate_constants": [-1.0]}, "rate_constants holds -1.0; expected at least 0"),
        ({"rate_constants": ["quick"]}, "rate_constants must be numbers"),
        ({"combinations": "unlike"}, "combinations = 'unlike'; expected one of distinct, ordered, product"),
        ({"conserved": {"mass": [1, 2]}}, "channel 'r' changes the conserved quantity 'mass' by 1"),
        ({"conserved": {"mass": [1, 1, 1]}}, "conserved 'mass' has shape"),
    ],
)
def test_bad_networks(change, message):
    with pytest.raises(ValueError, match=message):
        Network(**(ONE | change))


def test_bad_shape_of_states():
    with pytest.raises(ValueError, match=r"expected \(..., 4\)"):
        line().propensities([1, 2, 3])
