import numpy as np
import pytest
from known_systems import bare_line, line, network, switch
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import binom

from kinetics.markov import stationary
from kinetics.markov.transient import reachable, solve
from kinetics.network import Network


def slow_states(net, start):
    """Reachable states, one by one."""
    seen, todo = {tuple(start)}, [tuple(start)]
    while todo:
        state = np.array(todo.pop())
        for needed, change in zip(net.reactants, net.stoichiometry, strict=True):
            target = tuple(state + change)
            if (state >= needed).all() and target not in seen:
                seen.add(target)
                todo.append(target)
    return seen


@pytest.mark.parametrize(("cubes", "n_states"), [(60, 1906), (80, 4263), (120, 13561)])
def test_line_of_four(cubes, n_states):
    space = reachable(line(), [cubes, 0, 0, 0])
    assert len(space) == n_states
    assert_array_equal(space.states @ [1, 2, 3, 4], np.full(n_states, cubes))
    Q = space.generator()
    assert abs(Q.sum(axis=1)).max() < 1e-15
    assert Q.diagonal().max() < 0


def test_against_exploring_one_by_one():
    space = reachable(line(), [14, 0, 0, 0])
    assert {tuple(state) for state in space.states} == slow_states(line(), [14, 0, 0, 0])
    assert_array_equal(space.states[0], [14, 0, 0, 0])


def test_generator_entry_by_entry():
    net = line("table3_geometric")
    space = reachable(net, [8, 0, 0, 0])
    rows = {tuple(state): i for i, state in enumerate(space.states)}
    expected = np.zeros((len(space), len(space)))
    for state, i in rows.items():
        for rate, change in zip(net.propensities(state), net.stoichiometry, strict=True):
            if rate:
                expected[i, rows[tuple(state + change)]] += rate
                expected[i, i] -= rate
    assert_allclose(space.generator().toarray(), expected, rtol=1e-14, atol=0)


def test_index_of():
    space = reachable(line(), [20, 0, 0, 0])
    assert_array_equal(space.index_of(space.states), np.arange(len(space)))
    assert_array_equal(space.index_of([[19, 0, 0, 0], [20, 0, 0, 0]]), [-1, 0])


def test_rates_of_zero_lead_nowhere_and_unknown_rates_everywhere():
    joins_only = line().with_rates([1, 1, 1, 1, 0, 0, 0, 0])
    states = reachable(joins_only, [0, 2, 0, 1]).states
    assert_array_equal(states, [[0, 2, 0, 1], [0, 0, 0, 2]])
    assert len(reachable(bare_line(), [60, 0, 0, 0])) == 1906


def test_stopped_states_are_not_left():
    space = reachable(line(), [12, 0, 0, 0], stop=lambda states: states[:, 3] >= 1)
    assert space.states[:, 3].max() == 1
    stopped = space.generator()[np.flatnonzero(space.is_stopped)]
    assert abs(stopped).sum() == 0


def test_duplicate_channels_add_up_and_idle_ones_do_nothing():
    reactions = {"one": ((1,), (0,)), "two": ((1,), (0,)), "idle": ((1,), (1,))}
    Q = reachable(network(("A",), reactions, [1.0, 2.0, 5.0]), [1]).generator()
    assert_array_equal(Q.toarray(), [[-3, 3], [0, 0]])


def test_no_channels():
    net = Network(("A",), (), [], [], [], [])
    assert_array_equal(reachable(net, [3]).generator().toarray(), [[0.0]])


def test_large_counts():
    states = reachable(network(("A",), {"decay": ((10**12,), (0,))}, [0.0]), [5 * 10**15]).states
    assert_array_equal(states, [[5 * 10**15]])
    states = reachable(network(("A", "B"), {"turn": ((1, 0), (0, 1))}, [1.0]), [3, 10**15]).states
    assert_array_equal(states, [[3 - i, 10**15 + i] for i in range(4)])


def test_growth_without_limit_is_refused_with_its_pace():
    birth = network(("A", "B"), {"a": ((0, 0), (1, 0)), "b": ((0, 0), (0, 1))}, [1.0, 1.0])
    message = r"over 5000 states are reachable: 99 events .* goes 96, 97, 98, 99 with each.*A up to 99, B up to 98 and"
    with pytest.raises(ValueError, match=message):
        reachable(birth, [0, 0], max_states=5000)
    with pytest.raises(ValueError, match="beyond 2"):
        reachable(network(("A",), {"jump": ((1,), (2**62,))}, [1.0]), [2])


@pytest.mark.parametrize("states", [0, -1, 1.5, "x", True, None])
def test_a_largest_number_of_states_that_is_none_is_refused(states):
    with pytest.raises(ValueError, match=r"max_states = .*; expected a whole number of at least 1"):
        reachable(switch(), [3, 0], max_states=states)


def test_the_least_limit_is_refused_without_a_pace():
    with pytest.raises(ValueError, match=r"^over 1 states are reachable\. Start"):
        reachable(switch(), [3, 0], max_states=1)


def test_sparse_and_dense_tables_lead_to_the_same_states():
    """With channels that need more than they change, change nothing, and change many species at once."""
    species = ("A", "B", "C", "D")
    changing = {
        "idle": ((1, 0, 0, 0), (1, 0, 0, 0)),
        "catalysed": ((1, 1, 0, 0), (0, 1, 2, 0)),
        "all": ((0, 1, 2, 0), (1, 0, 0, 1)),
        "back": ((0, 0, 0, 3), (0, 1, 2, 0)),
    }
    net = network(species, changing, [1.0, 2.0, 3.0, 4.0])
    space = reachable(net, [3, 2, 0, 0])
    assert len(space) > 10
    assert {tuple(state) for state in space.states} == slow_states(net, [3, 2, 0, 0])
    found = set(zip(*(part.tolist() for part in space.transitions()[:3]), strict=True))
    rows = {tuple(state): i for i, state in enumerate(space.states)}
    expected = {
        (i, rows[tuple(np.array(state) + change)], rate)
        for state, i in rows.items()
        for rate, change in zip(net.propensities(state).tolist(), net.stoichiometry, strict=True)
        if rate and change.any()
    }
    assert found == expected


def test_a_conserved_quantity_that_changes_is_seen():
    space = reachable(switch(), [3, 0])
    lying = switch()
    object.__setattr__(lying, "conserved", {"copies": np.array([1.0, 2.0])})
    with pytest.raises(ArithmeticError, match="copies is not conserved"):
        type(space)(lying, space.states, space.is_stopped)


def test_a_space_that_is_not_closed_is_seen():
    space = reachable(switch(), [3, 0])
    torn = type(space)(space.network, space.states[:2].copy(), space.is_stopped[:2].copy())
    with pytest.raises(ArithmeticError, match="not closed"):
        torn.generator()


@pytest.mark.parametrize("method", ["exact", "fsp"])
def test_the_probability_of_some_counts_leaves_the_others_open(method):
    """Two independent species: what is not named is summed over, not 0."""
    pair = Network.from_text("A -> 0, 1\n0 <-> B, 3, 1" if method == "fsp" else "A -> 0, 1\nB <-> C, 3, 1")
    law = solve(pair, method, {"A": 4, "B": 3}, [0.5, 1.0])
    here = law.space.states[:, pair.index("A")] == 2
    assert_array_equal(law.probability({"A": 2}), law.probabilities[:, here].sum(axis=1))
    assert_allclose(law.probability({"A": 2}), law.marginal("A")[:, 2], rtol=1e-12)
    assert_allclose(law.probability({"A": 2}), binom(4, np.exp(-law.times)).pmf(2), atol=law.error + 1e-13)
    one = dict(zip(pair.species, law.space.states[3].tolist(), strict=True))
    assert_array_equal(law.probability(one), law.probabilities[:, 3])
    assert_array_equal(law.probability(list(one.values())), law.probabilities[:, 3])
    low, high = law.probability_bounds({"A": 2})
    exact = binom(4, np.exp(-law.times)).pmf(2)
    assert ((low <= exact) & (exact <= high) & (high - low < 1e-8)).all()
    assert law.probability({"A": 9}).tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match="unknown species 'Q'; the network has A, B"):
        law.probability({"A": 2, "Q": 0})
    with pytest.raises(ValueError, match="at least 0"):
        law.probability({"A": -1})


def test_the_stationary_probability_of_some_counts_too():
    pair = Network.from_text("A <-> X, 2, 3\nB <-> Y, 1, 1")
    law = stationary(pair, {"A": 2, "B": 3})
    assert law.probability({"A": 2}) == pytest.approx(0.36, rel=1e-12)
    assert law.probability({"A": 2, "B": 3}) == pytest.approx(0.36 / 8, rel=1e-12)
    with pytest.raises(ValueError, match="unknown species 'Q'"):
        law.probability({"Q": 1})
