"""The solver without a stored matrix: against others, closed forms, and what it refuses."""

import os
import signal
import threading
import time
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from known_systems import line, network, switch
from numpy.testing import assert_allclose, assert_array_equal
from sampled_networks import ENZYME, MIXED, PRODUCTS, THIRD_ORDER, ring
from scipy.stats import multinomial, poisson

from kinetics import Chain, MatrixFree, Network, Transient, reachable, reached_by
from kinetics.markov.transient import InterruptedSolutionError
from kinetics.markov.transient.packed import PackedChain, Packing
from kinetics.markov.transient.search import TooManyStatesError
from kinetics.native import packed
from kinetics.support import memory

SOLVER = MatrixFree.followed.__globals__  # of its module, whichever copy of it a collection of examples has made

CASES = {
    "line": (line(), [24, 0, 0, 0], [0.0, 40.0, 900.0]),
    "enzyme": (ENZYME, [6, 20, 0, 0], [0.5, 3.0]),
    "mixed": (MIXED, [20, 5, 4], [0.3, 1.0]),
    "third order": (THIRD_ORDER, [17, 2], [0.2, 2.0]),
    "products": (PRODUCTS, [13, 0], [0.25, 1.0]),
    "ordered": (replace(PRODUCTS, combinations="ordered"), [13, 0], [0.25, 1.0]),
    "ring": (ring(5), [4, 3, 0, 0, 1], [0.5, 2.0]),
    "law": (replace(ENZYME, laws={"turn": "ES / (1.0 + S)"}), [4, 15, 0, 0], [0.5, 3.0]),
}


def everywhere(found, space):
    """Probabilities (T, N) of a solution on the states of another space, all of its own among them."""
    rows = space.index_of(found.space.states)
    assert rows.min() >= 0
    table = np.zeros((found.times.size, len(space)))
    table[:, rows] = found.probabilities
    return table


def distances(found, exact):
    """Summed absolute errors (T,) against a solution on all states."""
    return abs(everywhere(found, exact.space) - exact.probabilities).sum(axis=1)


def random_network(seed):
    """Up to five species and twelve channels of orders zero to three, conserving a weighted sum of counts."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    weights = rng.integers(1, 4, n)
    sides, reactions = [], {}
    while len(sides) < 12:
        side = rng.integers(0, 3, n)
        if 1 <= side.sum() <= 3:
            sides.append(side)
    for before in sides:
        others = [after for after in sides if weights @ after == weights @ before and (after != before).any()]
        for after in others[:2]:
            reactions[f"r{len(reactions)}"] = (tuple(before), tuple(after))
    if not reactions:
        return random_network(seed + 1000)
    start = rng.integers(0, 7, n)
    return network("ABCDE"[:n], reactions, list(rng.uniform(0.01, 1.0, len(reactions)))), start


@pytest.mark.parametrize("tolerance", [1e-6, 1e-11])
@pytest.mark.parametrize("name", CASES)
def test_it_agrees_with_the_solver_on_all_states(name, tolerance):
    net, start, times = CASES[name]
    found, exact = MatrixFree(tolerance).solve(net, start, times), Transient().solve(net, start, times)
    assert distances(found, exact).max() < found.error + exact.error
    assert found.error < tolerance + 1e-12
    assert found.is_bound == exact.is_bound
    assert_allclose(found.mean(), exact.mean(), rtol=0, atol=(found.error + exact.error) * 100)
    assert_array_equal(found.space.states[0], start)


@pytest.mark.parametrize("seed", range(30))
def test_random_networks_agree(seed):
    net, start = random_network(seed)
    times = [0.0, 0.1, 1.5]
    found, exact = MatrixFree(1e-11).solve(net, start, times), Transient().solve(net, start, times)
    assert distances(found, exact).max() < min(found.error + exact.error, 1e-10)


def test_independent_conversions_are_multinomial():
    # Each copy walks on its own: A -> B -> C with rates 1 and 2.
    net = network("ABC", {"ab": ((1, 0, 0), (0, 1, 0)), "bc": ((0, 1, 0), (0, 0, 1))}, [1.0, 2.0])
    found = MatrixFree(1e-9).solve(net, [60, 0, 0], [0.4, 2.0])
    for t, (time_, mass) in enumerate(zip(found.times, found.probabilities, strict=True)):
        a = np.exp(-time_)
        b = np.exp(-time_) - np.exp(-2.0 * time_)
        exact = multinomial(60, [a, b, 1 - a - b]).pmf(found.space.states)
        assert abs(mass - exact).sum() + 1.0 - exact.sum() < found.error + 1e-12, t
        # The control: rates a thousandth off are seen, as a narrower bound would not be kept.
        wrong = multinomial(60, [a * 1.001, b, 1 - a * 1.001 - b]).pmf(found.space.states)
        assert abs(mass - wrong).sum() > 1e3 * found.error


def test_a_narrowed_bound_does_not_hold():
    exact = Transient().solve(line(), [30, 0, 0, 0], [400.0])
    found = MatrixFree(1e-7).solve(line(), [30, 0, 0, 0], [400.0])
    assert 0.5 * found.error < distances(found, exact)[0] < found.error + exact.error


def test_infinite_spaces_are_followed():
    net = Network.from_text("0 <-> A, 5, 1; 0 <-> B, 3, 1".replace("; ", "\n"))
    found = MatrixFree(1e-9).solve(net, [0, 0], [1.5])
    a, b = found.space.states.T
    exact = poisson(5 * (1 - np.exp(-1.5))).pmf(a) * poisson(3 * (1 - np.exp(-1.5))).pmf(b)
    assert abs(found.probabilities[0] - exact).sum() + 1 - exact.sum() < found.error + 1e-12 < 1.01e-9


def test_a_settled_distribution_is_kept():
    found = MatrixFree(1e-7).solve(switch(3.0, 5.0), [6, 0], [40.0, 2000.0])
    exact = Transient().solve(switch(3.0, 5.0), [6, 0], [40.0, 2000.0])
    assert distances(found, exact).max() < found.error + exact.error < 1.1e-7


def test_two_threads_give_the_same_bits(monkeypatch):
    one = MatrixFree(1e-8).solve(line(), [40, 0, 0, 0], [30.0, 300.0])
    monkeypatch.setattr(packed, "SHARED", 0)
    two = MatrixFree(1e-8).solve(line(), [40, 0, 0, 0], [30.0, 300.0])
    assert_array_equal(one.space.states, two.space.states)
    assert_array_equal(one.probabilities, two.probabilities)
    assert one.error == two.error


@pytest.mark.parametrize("name", CASES)
def test_propensities_are_those_of_the_network(name):
    net, start, _ = CASES[name]
    packing = Packing.of(net, np.array(start))
    states = reachable(net, start).states
    keys = packing.keys(states)
    assert_array_equal(packing.counts(keys), states)
    chain = PackedChain(packing, None, None)
    rows = chain.rows(np.sort(keys))
    expected = net.propensities(packing.counts(rows.keys))[:, packing.chosen]
    assert_allclose(rows.exits, expected.sum(axis=1), rtol=1e-14)
    bits = (rows.able[:, :1] >> np.arange(packing.chosen.size, dtype=np.uint64)) & np.uint64(1)
    assert_array_equal(bits.astype(bool), expected > 0.0)


@pytest.mark.parametrize("target", ["D >= 3", "A <= 4"])
def test_targets_are_reached_as_often_as_in_the_chain(target):
    net, start, times = line(), {"A": 20}, [0.0, 30.0, 2000.0]
    net = replace(net, species=("A", "B", "C", "D"))
    found = reached_by(net, target, times, initial=start)
    chain = Chain.of(net, start)
    for at, answer in zip(times, found, strict=True):
        exact = chain.until(target, by=at)
        assert answer.low <= exact.high
        assert exact.low <= answer.high
        assert answer.high - answer.low < 1.01e-9
        assert answer.kind == "proven"
    assert found[2].value > 0.01


def test_failures_are_no_successes():
    net, start = replace(line(), species=("A", "B", "C", "D")), {"A": 16}
    (found,) = reached_by(net, "D >= 2", [400.0], through="C <= 2", initial=start)
    chain = Chain.of(net, start)
    exact, other = chain.until("D >= 2", through="C <= 2", by=400.0), chain.until("D >= 2", by=400.0)
    assert found.low <= exact.value <= found.high
    assert not found.low <= other.value <= found.high
    (at_once,) = reached_by(net, "A >= 2", [1.0], initial=start)
    assert at_once.low <= at_once.value == 1.0 == at_once.high
    (never,) = reached_by(net, "D >= 2", [1.0], through="A < 2", initial=start)
    assert never.value == 0.0 <= never.high < 1e-12


def test_refusals():
    with pytest.raises(TooManyStatesError, match=r"over 100 states matter: \d+ held all but 1e-09 .* Ask for"):
        MatrixFree(max_states=100).solve(line(), [40, 0, 0, 0], [400.0])
    with pytest.raises(ValueError, match="too stiff"):
        MatrixFree().solve(switch(1e8, 1e8), [1, 0], [1.0])
    many = network("ABCDEFGH", {"ab": ((1,) + 7 * (0,), (0, 1) + 6 * (0,))}, [1.0])
    with pytest.raises(ValueError, match=r"8 species do not fit into one number of 62 bits"):
        MatrixFree().solve(many, [10**4] * 8, [1.0])
    doubling = network("AB", {"a": ((1, 0), (2, 0)), "b": ((1, 0), (1, 1))}, [20.0, 1.0])
    with pytest.raises(ValueError, match=r"states matter|too stiff|grows beyond"):
        MatrixFree(max_states=5000).solve(doubling, [1, 0], [5.0])
    with pytest.raises(ValueError, match="time"):
        MatrixFree().solve(replace(switch(), laws={"forward": "A * (1 + 0.5 * sin(t))"}), [5, 0], [1.0])


def test_what_is_large_is_forecast_before_it_is_done(monkeypatch):
    monkeypatch.setitem(SOLVER, "LARGE", 50)
    said = []
    monkeypatch.setitem(SOLVER, "forecast", lambda seconds, what: said.append((seconds, what)))
    MatrixFree(1e-9).solve(line(), [40, 0, 0, 0], [400.0])
    ((seconds, what),) = said
    assert 0.0 < seconds < 60.0
    assert "states at once" in what
    monkeypatch.setattr(memory, "SMALL", 0)
    monkeypatch.setattr(memory, "available_bytes", lambda: 2e5)
    with pytest.raises(ValueError, match="GB of memory"):
        MatrixFree(1e-9).solve(line(), [60, 0, 0, 0], [400.0])
    monkeypatch.undo()
    monkeypatch.setitem(SOLVER, "LARGE", 50)
    monkeypatch.setitem(SOLVER, "expected", lambda *_: (1e9, 1e5))
    with pytest.raises(ValueError, match=r"about 1e\+09 s of CPU time \(about .* states at once.*max_seconds = "):
        MatrixFree(1e-9).solve(line(), [60, 0, 0, 0], [400.0])


def test_an_interrupt_is_heard_and_keeps_the_times_that_are_finished():
    net, start, times = line(), [90, 0, 0, 0], [1.0, 1e5]
    began = []

    def ctrl_c():
        began.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    def again_and_again():
        while True:  # until it comes
            MatrixFree(1e-12).solve(net, start, times)

    timer = threading.Timer(0.5, ctrl_c)
    timer.start()
    with pytest.raises(InterruptedSolutionError) as stopped:
        again_and_again()
    assert time.monotonic() - began[0] < 1.0
    assert stopped.value.finished is None or stopped.value.finished.times.tolist() in ([1.0], [1.0, 1e5])


def test_finished_times_come_with_an_interrupt():
    advance, calls = SOLVER["Windows"].advance, []

    def once(self):
        if len(self.found) == 2:
            calls.append(self.time)
            raise KeyboardInterrupt
        advance(self)

    with patch.object(SOLVER["Windows"], "advance", once), pytest.raises(InterruptedSolutionError) as stopped:
        MatrixFree(1e-9).solve(line(), [20, 0, 0, 0], [0.0, 10.0, 2000.0])
    kept = stopped.value.finished
    exact = Transient().solve(line(), [20, 0, 0, 0], [0.0, 10.0])
    assert_array_equal(kept.times, [0.0, 10.0])
    assert distances(kept, exact).max() < kept.error + exact.error < 1.1e-9
