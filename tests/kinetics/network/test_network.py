from math import comb, perm

import numpy as np
import pytest
from known_systems import bare_line, decay, line, network
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Auto, Direct, General, Lockstep
from kinetics.network import Network
from kinetics.network.sparse_tables import SparseTable
from kinetics.sampling import simulate

ONE = {
    "species": ("A", "B"),
    "channels": ("r",),
    "sparse_reactants": [[2, 1]],
    "sparse_stoichiometry": [[-1, 1]],
    "ways": [3],
}


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


@pytest.mark.parametrize("order", [16, 17, 60, 171, 250])
def test_combinations_of_high_order_are_right(order):
    for name, count in (("distinct", comb), ("ordered", perm), ("product", lambda s, m: s**m if s >= m else 0)):
        net = network(("A",), {"all": ((order,), (0,))}, [1.0], name)
        for copies in (order - 1, order, order + 3, 10**6):
            expected = count(copies, order)
            if expected < 10**308:
                assert_allclose(net.propensities([copies]), [float(expected)], rtol=1e-14)
            else:
                with pytest.raises(ValueError, match=f"{order} like reactants among {copies} copies have more"):
                    net.propensities([copies])
    assert_array_equal(net.combinations_of([[[0], [1]], [[2], [3]]]), np.zeros((2, 2, 1)))


def test_orders_that_cannot_be_sampled_are_refused_by_name():
    for order, rate in ((171, 1.0), (170, 1e-3), (100, 1e-200)):
        net = network(("A",), {"all": ((order,), (0,))}, [rate])
        for method in (Direct(), General(), Lockstep(), Auto()):
            with pytest.raises(ValueError, match=f"'all' needs {order} copies of one species: .* too small"):
                method.simulate(net, [order], [1.0], runs=1)
    few = network(("A",), {"all": ((20,), (0,))}, [1.0]).with_rates([1e3])
    assert Direct().simulate(few, [20], [1.0], runs=3).counts.max() == 0


@pytest.mark.parametrize("counted", ["distinct", "ordered", "product"])
def test_combinations_of_millions_are_refused_before_they_are_counted(counted):
    """Their whole numbers have millions of digits."""
    net = network(("A",), {"all": ((2 * 10**9,), (0,))}, [1.0], counted)
    with pytest.raises(ValueError, match="2000000000 like reactants among 5000000000 copies have more combinations"):
        net.propensities([5 * 10**9])
    assert net.propensities([10**9]) == 0.0
    if counted == "distinct":
        assert_array_equal([net.propensities([2 * 10**9 + more]) for more in (0, 1)], [[1.0], [2 * 10**9 + 1.0]])


def test_what_is_beyond_a_float_is_refused_by_the_channel():
    reactions = {"easy": ((1, 1), (0, 1)), "all": ((60, 60), (0, 60))}
    net = network(("A", "B"), reactions, [1.0, 1.0])
    assert np.isfinite(net.propensities([70, 70])).all()
    with pytest.raises(ValueError, match="channel 'all': its reactants have too many combinations"):
        net.propensities([10**6, 10**6])
    with pytest.raises(ValueError, match="channel 'all': its reactants have too many combinations: 60 like reactants"):
        net.propensities([10**9, 1])
    with pytest.raises(ValueError, match="channel 'all': its propensity is beyond what a float can hold"):
        net.with_rates([1.0, 1e300]).propensities([[70, 70], [1000, 1000]])


def test_no_channels():
    net = Network(("A",), (), [], [], [], [])
    assert net.propensities([5]).shape == (0,)
    assert "0 channels" in str(net)


def test_rates_missing():
    with pytest.raises(ValueError, match="no rate constants yet; set them"):
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
    assert repr(decay()) == "<Network: 1 species, 1 channel; distinct combinations>"


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
        ({"sparse_reactants": [[2, 1], [1, 0]]}, r"reactants has shape \(2, 2\); expected \(1, 2\)"),
        ({"sparse_reactants": [[2, -1]]}, "reactants holds -1; expected at least 0"),
        ({"sparse_reactants": [[0.5, 1]]}, "reactants must be whole numbers; 0.5 is not one"),
        ({"sparse_stoichiometry": [[-3, 1]]}, "takes 3 of 'A' but needs only 2; raise its reactants"),
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


def test_networks_without_dense_tables_are_the_same_networks():
    net = bare_line()
    same = Network(
        net.species, net.channels, net.sparse_reactants, net.sparse_stoichiometry, net.ways, conserved=net.conserved
    )
    assert "reactants" not in same.__dict__
    assert same.fingerprint == net.fingerprint
    assert str(same) == str(net)
    states = [[5, 3, 2, 1], [0, 1, 0, 0]]
    assert_array_equal(same.combinations_of(states), net.combinations_of(states))
    assert_array_equal(same.reactants, net.reactants)
    assert_array_equal(same.stoichiometry, net.stoichiometry)
    assert same.with_rates(np.ones(8)).fingerprint == net.fingerprint
    with pytest.raises(ValueError, match="read-only"):
        same.reactants[0, 0] = 7


def test_reactions_by_name():
    net = Network.from_reactions(
        {"bind": ({"A": 1, "B": 2}, {"C": 1}), "make": ({}, {"A": 1}), "help": ({"C": 1, "A": 1}, {"C": 1, "B": 1})},
        [1.0, 2.0, 3.0],
    )
    assert net.species == ("A", "B", "C")
    assert_array_equal(net.reactants, [[1, 2, 0], [0, 0, 0], [1, 0, 1]])
    assert_array_equal(net.stoichiometry, [[-1, -2, 1], [1, 0, 0], [-1, 1, 0]])
    assert Network.from_reactions({"x": ({"A": 1}, {})}, species=("B", "A")).reactants.tolist() == [[0, 1]]


@pytest.mark.parametrize(
    ("reactions", "keywords", "message"),
    [
        ({"x": ({"A": 1}, {"B": 1})}, {"species": ("A",)}, "unknown species 'B'; the network has A"),
        ({"x": ({"A": -1}, {})}, {}, "copies holds -1; expected at least 0"),
        ({"x": ({"A": 1.5}, {})}, {}, "copies must be whole numbers; 1.5 is not one"),
        ({"x": ({"A": 1}, {})}, {"rate_constants": [1.0, 2.0]}, "rate_constants has shape"),
        ({"x": "A + B -> C"}, {}, "reaction 'x' is 'A . B -> C'; expected copies needed and made.*Network.from_text"),
        ({"x": ({"A": 1},)}, {}, "reaction 'x' is .*expected copies needed and made"),
        ({}, {}, "at least one species"),
    ],
)
def test_bad_reactions(reactions, keywords, message):
    with pytest.raises(ValueError, match=message):
        Network.from_reactions(reactions, **keywords)


def test_bad_terms():
    good = bare_line()
    narrow = SparseTable.of_entries((8, 3), [0], [1], [1])
    with pytest.raises(ValueError, match=r"stoichiometry has shape \(8, 3\); expected \(8, 4\)"):
        Network(good.species, good.channels, good.sparse_reactants, narrow, good.ways)
    negative = SparseTable.of_entries((8, 4), [0], [1], [-1])
    with pytest.raises(ValueError, match="reactants holds -1; expected at least 0"):
        Network(good.species, good.channels, negative, good.sparse_stoichiometry, good.ways)
    with pytest.raises(ValueError, match="rows holds 8; the table has only 8"):
        SparseTable.of_entries((8, 4), [8], [1], [1])


def test_sparse_tables():
    rng = np.random.default_rng(5)
    table = rng.integers(-2, 3, (9, 6)) * (rng.random((9, 6)) < 0.4)
    sparse = SparseTable.of_dense(table)
    assert sparse.shape == (9, 6)
    assert_array_equal(sparse.dense(), table)
    places = rng.permutation(np.flatnonzero(table.ravel()))
    halves = table.ravel()[places]
    entries = [np.concatenate([part, part]) for part in (places // 6, places % 6, halves)]
    assert_array_equal(SparseTable.of_entries((9, 6), *entries).dense(), 2 * table)  # entries of one place are added up
    assert_array_equal(SparseTable.of_entries((9, 6), [1, 1], [2, 2], [3, -3]).copies, [])
    assert_array_equal(sparse.at(np.arange(54)), table.ravel())
    rows = np.array([4, 0, 4, 8])
    owners, chosen = sparse.entries_of(rows)
    again = np.zeros((4, 6), dtype=int)
    again[owners, sparse.columns[chosen]] = sparse.copies[chosen]
    assert_array_equal(again, table[rows])


def test_tens_of_thousands_of_channels():
    n = 30_000
    names = [f"s{i}" for i in range(n)]
    net = Network.from_reactions({f"r{i}": ({names[i]: 1}, {names[(i + 1) % n]: 1}) for i in range(n)}, np.ones(n))
    assert len(net.fingerprint) == 64
    assert net.with_rates(2 * np.ones(n)).fingerprint == net.fingerprint
    other = Network.from_reactions({f"r{i}": ({names[i]: 1}, {names[i - 1]: 1}) for i in range(n)}, species=net.species)
    assert other.fingerprint != net.fingerprint
    assert net.propensities(np.arange(n)).sum() == n * (n - 1) / 2
    with pytest.raises(ValueError, match=r"30000 channels by 30000 species as a dense table need 6\.7 GB; read"):
        _ = net.reactants


def test_one_time_that_is_no_list_is_told():
    network = Network.from_text("A -> B, 1")
    with pytest.raises(ValueError, match=r"times = 100; expected a list or an array of shape \(any\)"):
        simulate(network, "ssa", {"A": 3}, 100)
