"""What is no chain, target, label or reward is refused, and says why."""

import numpy as np
import pytest
from known_systems import line
from scipy.linalg import expm
from scipy.sparse import coo_array, csr_array

from kinetics import Chain, Reward, first_passage
from kinetics.markov import chain_path, sensitivity_to

RATES = np.array([[0, 1.0, 0], [2.0, 0, 1.0], [0, 0, 0]])
GENERATOR = RATES - np.diag(RATES.sum(axis=1))
NAN = np.where(RATES == 2.0, np.nan, RATES)


def test_rates_and_generators_are_the_same_chain():
    exact = expm(np.vstack([GENERATOR[:2], np.zeros(3)]))[0, 2]
    for given in (RATES, GENERATOR, csr_array(RATES), csr_array(GENERATOR), GENERATOR * (1 + 1e-15)):
        assert Chain(given, 0).until([False, False, True], by=1.0).value == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(
    ("generator", "initial", "message"),
    [
        (GENERATOR + np.diag([0.1, 0, 0]), 0, "row 0 of the generator sums to 0.1; expected 0"),
        (-RATES, 0, "rate from state 1 to state 0 is -2; expected at least 0"),
        (NAN, 0, "generator holds nan; expected finite"),
        (csr_array(NAN), 0, "generator holds nan; expected finite"),
        # what cancels in doubles once left no rate at all, and an answer of 0
        (coo_array(([1e16, 1.0, -1e16], ([0] * 3, [1] * 3)), shape=(2, 2)), 0, "from state 0 to state 1 is -1e\\+16"),
        (csr_array(RATES * 1j), 0, "generator holds complex numbers"),
        (np.minimum(RATES, 1.0) * 1e308, 0, "a state has an exit rate of inf 1/tu; the largest allowed is 1e\\+300"),
        (RATES[:2], 0, r"generator has shape \(2, 3\); expected a square"),
        (np.zeros((0, 0)), 0, "generator has no states"),
        ([["a"]], 0, "generator must be numbers"),
        (RATES, 3, "initial state 3; expected 0 to 2"),
        (RATES, True, "initial = True; expected a whole number"),
        (RATES, 1.0, r"initial = 1\.0; expected a whole number"),
        (RATES, [0.5, 0.4, 0.0], "initial sums to 0.9; expected probabilities that sum to 1"),
        (RATES, [1.5, -0.5, 0.0], "initial holds -0.5; expected at least 0"),
        (RATES, [1.0, 0.0], r"initial has shape \(2,\); expected \(3\)"),
        (RATES, [np.nan, 0.5, 0.5], "initial holds nan"),
    ],
)
def test_no_chain(generator, initial, message):
    with pytest.raises(ValueError, match=message):
        Chain(generator, initial)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"labels": {"a": [True, False]}}, r"label 'a' is bool of shape \(2,\); expected one truth a state, \(3,\)"),
        ({"labels": {"a": [0, 1, 2]}}, "label 'a' is int64"),
        ({"labels": {"": [True] * 3}}, "'' is no name of a label"),
        ({"labels": {"x": [True] * 3}, "variables": ("x",), "counts": [[0], [1], [2]]}, "both a label and a variable"),
        ({"rewards": {"r": [1.0, -2.0, 0.0]}}, "reward 'r' holds -2; expected at least 0"),
        ({"rewards": {"r": [1.0, np.inf, 0.0]}}, "reward 'r' holds inf"),
        ({"rewards": {"r": [1.0, 2e-323, 0.0]}}, "reward 'r' holds 1.97626e-323; expected 0 or 1e-200 at least"),
        ({"rewards": {"r": Reward(impulses=np.eye(2))}}, r"impulses of reward 'r' has shape \(2, 2\)"),
        ({"rewards": {"r": "x + 1"}}, "unknown name 'x'"),
        ({"rewards": {"r": "1 / x"}, "variables": ("x",), "counts": [[2], [0], [1]]}, "no finite number in state 1"),
        ({"variables": ("x",)}, "came without counts"),
        ({"variables": ("x",), "counts": [[1], [2]]}, r"counts has shape \(2, 1\)"),
    ],
)
def test_bad_descriptions(arguments, message):
    with pytest.raises(ValueError, match=message):
        Chain(RATES, 0, **arguments)


@pytest.fixture(scope="module")
def chain():
    return Chain(RATES, 0, {"end": np.arange(3) == 2}, {"r": np.ones(3)}, ("x",), np.arange(3)[:, None])


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda c: c.until("y >= 1"), "unknown name 'y'; the variables are x, the labels end"),
        (lambda c: c.until("x"), "x is a number, neither true nor false; compare it, as in x >= 1"),
        (lambda c: c.until("x >= 1 and x"), "x is a number"),
        (lambda c: c.until("x >= "), "cannot read"),
        (lambda c: c.until("x >= t"), "depends on the time"),
        (lambda c: c.until("x => end"), "x is a number, neither true nor false"),
        (
            lambda c: c.until("x > 0 => x > 1 => end"),
            "a => b => c is read in two ways by programs; write brackets at column 16",
        ),
        (lambda c: c.until("__import__('os')"), "unknown function"),
        (lambda c: c.until([True, False]), r"target is bool of shape \(2,\)"),
        (lambda c: c.until("end", by=-1.0), "times holds -1"),
        (lambda c: c.until("end", by=np.nan), "times holds nan"),
        (lambda c: c.until("end", by="1"), "by = '1'; expected a number"),
        (lambda c: c.reward("s", at=1.0), "unknown reward 's'; there are r, x"),
        (lambda c: c.reward("r"), "give one of at, up_to, until and stationary"),
        (lambda c: c.reward("r", at=1.0, up_to=2.0), "give one of"),
        (lambda c: c.transient([]), "times is empty"),
        (lambda c: c.transient([2.0, 1.0]), "times must rise"),
        (lambda c: c.committor({}), "no targets"),
        (lambda c: c.committor({"a": "x >= 1", "b": "end"}), r"state \[2\] belongs to two targets"),
    ],
)
def test_bad_questions(chain, ask, message):
    with pytest.raises(ValueError, match=message):
        ask(chain)


def test_an_impulse_has_no_rate_at_one_time():
    chain = Chain(RATES, 0, rewards={"jumps": Reward(impulses=RATES)})
    with pytest.raises(ValueError, match="impulses, which have no rate at one time"):
        chain.reward(at=1.0)
    assert chain.reward(up_to=1.0).value > 0


def test_too_many_states_are_refused():
    with pytest.raises(ValueError, match="over 100 states are reachable"):
        Chain.of(line(), {"monomer": 60}, max_states=100)
    with pytest.raises(ValueError, match="unknown name 'pentamer'"):
        Chain.of(line(), {"monomer": 6}, stop="pentamer >= 1")


INTEGERS = (int, np.int64, np.uint8, np.array)


@pytest.mark.parametrize("kind", INTEGERS)
def test_whole_numbers_of_any_type(kind):
    """Python's, numpy's, and arrays without an axis."""
    network, start = line(), {"monomer": 8}
    assert len(Chain.of(network, start, truncate=kind(10))) == len(Chain.of(network, start, truncate=10))
    assert len(Chain.of(network, start, max_states=kind(100))) == 15
    assert Chain(RATES, kind(1)).initial[1] == 1.0
    path = chain_path(Chain(RATES, 0), 1.0, seed=kind(3), run=kind(2))
    assert np.array_equal(path.times, chain_path(Chain(RATES, 0), 1.0, seed=3, run=2).times)
    assert first_passage(network, start, "quadmer", kind(2)).mean == first_passage(network, start, "quadmer", 2).mean
    goals = [sensitivity_to(network, start, "quadmer", copies)[1] for copies in (kind(2), 2)]
    assert np.array_equal(*goals)


@pytest.mark.parametrize("number", [True, np.True_, 2.5, 0])
def test_truths_and_fractions_are_no_whole_numbers(number):
    network, start = line(), {"monomer": 8}
    refused = pytest.raises(ValueError, match="expected a whole number of at least 1")
    with refused:
        Chain.of(network, start, truncate=number)
    with refused:
        Chain.of(network, start, max_states=number)
    if number != 0:
        with pytest.raises(ValueError, match="expected a whole number of at least 0"):
            sensitivity_to(network, start, "quadmer", number)
        with pytest.raises(ValueError, match="expected a whole number of at least 0"):
            chain_path(Chain(RATES, 0), 1.0, seed=number)
