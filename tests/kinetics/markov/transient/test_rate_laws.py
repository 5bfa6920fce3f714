"""Bounds under rate laws: they hold where digits cancel, are near those of mass action elsewhere, or are no bounds."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.stats import poisson

from kinetics import Chain, FiniteStateProjection, Sensitivity, Transient, first_passage, solve, stationary
from kinetics.markov.transient import SOLVING_METHODS, Collocation, Dense
from kinetics.markov.transient.poisson import poisson_tails, poisson_window
from kinetics.markov.transient.states import reachable
from kinetics.markov.transient.uniformisation import DiscreteChain
from kinetics.network import Network
from kinetics.network.laws import hill, michaelis_menten

METHODS = pytest.mark.parametrize("method", SOLVING_METHODS, ids=lambda method: method.name)
NOTHING_KNOWN = "1e17 * (1 - exp(-1e-17 * S))"
FEW_DIGITS = "2e9 * (1 - exp(-S / 1e9))"


def decay(law, **parameters):
    return Network.from_reactions({"d": ({"S": 1}, {})}, [law], parameters=parameters)


def exact_decay(rate, copies, time):
    """Probabilities (copies + 1,) of the counts, to 100 digits, for deaths at rate(n)."""
    with mpmath.workdps(100):
        generator = mpmath.zeros(copies + 1)
        for n in range(1, copies + 1):
            generator[n, n], generator[n, n - 1] = -rate(mpmath.mpf(n)), rate(mpmath.mpf(n))
        return mpmath.expm(generator * time, method="taylor")[copies, :]


def distance(solution, exact):
    """Summed distance of the first time's probabilities of the counts of S."""
    found = solution.marginal("S")[0]
    with mpmath.workdps(100):
        return float(sum(abs(mpmath.mpf(p) - q) for p, q in zip(found, exact, strict=True)))


@METHODS
def test_a_law_of_which_nothing_is_known_gives_no_bound(method):
    """Its values are 0 or 11.1 instead of 10, say, as the library rounds; the mean is off by a tenth and more."""
    found = method().solve(decay(NOTHING_KNOWN), [10], [1.0])
    assert abs(found.mean()[0, 0] - 10 * np.exp(-1.0)) > 0.1
    assert not found.is_bound


@METHODS
def test_a_law_that_loses_digits_has_a_bound_that_holds(method):
    found = method().solve(decay(FEW_DIGITS), [20], [0.5])
    exact = exact_decay(lambda n: 2 * mpmath.mpf(10) ** 9 * (1 - mpmath.exp(-n / mpmath.mpf(10) ** 9)), 20, 0.5)
    off = distance(found, exact)
    assert found.is_bound
    assert 1e-9 < off < found.error < 1e-4
    as_if_by_mass_action = solve(decay(2.0), method(), [20], [0.5]).error
    assert off > as_if_by_mass_action  # the control: what was said before


@METHODS
def test_bounds_of_the_named_laws_hold_and_are_near_those_of_mass_action(method):
    law, plain = decay(michaelis_menten("S", 3.0, 17.3)), decay(0.15)
    found, same = (method().solve(net, [20], [2.0]) for net in (law, plain))
    with mpmath.workdps(100):
        off = distance(found, exact_decay(lambda n: 3 * n / (mpmath.mpf(17.3) + n), 20, 2.0))
    assert found.is_bound
    assert off < found.error < 2.0 * same.error + 5e-14 + (1e-9 if method is FiniteStateProjection else 0.0)
    steep = decay(hill("S", 3.0, 7.1, 2.7))
    assert method().solve(steep, [20], [2.0]).is_bound


def loop():
    """Production that is repressed, saturated conversion, and decay."""
    reactions = {"make": ({}, {"A": 1}), "turn": ({"A": 1}, {"B": 1}), "end": ({"B": 1}, {})}
    return Network.from_reactions(
        reactions, ["3 / (1 + (B / 4) ** 2.5)", michaelis_menten("A", 2.0, 10.0), 0.5], species=("A", "B")
    )


def test_a_network_of_laws_by_projection():
    found = FiniteStateProjection(1e-10).solve(loop(), [0, 0], [1.0, 30.0])
    assert found.is_bound
    assert found.error < 2e-10
    lost = replace(loop(), laws={**loop().laws, "turn": "floor(A / 3 * 3)"})
    assert not FiniteStateProjection(1e-10).solve(lost, [0, 0], [1.0]).is_bound


def closed(law):
    pair = {"ab": ({"A": 1}, {"B": 1}), "ba": ({"B": 1}, {"A": 1})}
    return Network.from_reactions(pair, [law, 0.7])


def test_questions_under_laws():
    """Relative errors of passage and stationary answers, by a law that is mass action and by one that loses digits."""
    for law, least, most in (("0.3 * A", 0.0, 1.5), ("3e8 * (1 - exp(-A / 1e9))", 1e6, 1e11)):
        net, plain = closed(law), closed(0.3)
        for ask in (lambda net: first_passage(net, [9, 0], "B", 7), lambda net: stationary(net, [9, 0])):
            found, same = ask(net), ask(plain)
            assert found.is_bound
            assert least * same.error <= found.error <= most * same.error
    passage = first_passage(closed("3e8 * (1 - exp(-A / 1e9))"), [9, 0], "B", 7)
    exact = first_passage(closed(0.3), [9, 0], "B", 7)  # the law in the limit, closer than the error
    assert abs(passage.mean / exact.mean - 1.0) < passage.error
    assert passage.error > 100.0 * exact.error
    low, high = passage.cdf_bounds([3.0])
    assert low[0] < exact.cdf([3.0])[0] < high[0]


@pytest.mark.parametrize("method", [Dense(), Collocation(), Transient()], ids=lambda method: method.name)
def test_errors_of_rates_count_in_every_jump(method):
    """Rates that are all wrong by as much as they may be: the answer moves, and stays within the bound."""
    chain = Chain.of(closed(0.3), [9, 0]).transitions
    wrong, start = chain._replace(rate_error=2.0**53 * 1e-6), np.eye(1, chain.size)[0]
    raised = chain._replace(rates=np.where(chain.rows < chain.columns, chain.rates * (1 + 1e-6), chain.rates))
    for times in (np.array([0.01]), np.array([0.3, 4.0, 50.0])):
        known, doubted, other = (method.probabilities(c, start, times) for c in (chain, wrong, raised))
        off = abs(other.probabilities - known.probabilities).sum(axis=1).max()
        jumps = 2.0 * 1e-6 * 9 * 0.7 * times[-1]
        assert known.error < off < doubted.error < 1.1 * jumps + known.error


def test_a_rate_that_may_be_above_zero_is_not_taken_for_none():
    """What is 0 only after rounding would hide states: no bound, whatever follows from the states alone."""
    net = closed("max(0, 0.1 * A - 0.3)")
    assert reachable(net, [3, 0]).rate_errors[0] == np.inf
    chain = Chain.of(net, [3, 0])
    assert chain.until("B >= 1").low in (0.0, 1.0)
    assert not chain.until("B >= 1").is_bound
    assert Chain.of(closed("max(0, A - 3)"), [3, 0]).until("B >= 1").is_bound


def test_derivatives_that_seem_to_be_zero_are_not_proven_under_such_a_law():
    # A a time unit, which the machine takes for none
    for law, is_bound in (("1e17 + A - 1e17", False), ("max(0, A - 3)", True)):
        net = closed(law)
        asked = Sensitivity(Chain.of(net, [3, 0]))
        for found in (asked.until("B >= 1"), asked.until("B >= 1", by=1.0), asked.reward("B", up_to=1.0)):
            assert not found.value.any()
            assert (found.is_bound, found.answer.is_bound) == (is_bound, is_bound)


def test_distributions_of_passages_hold_what_a_law_rounds():
    # 0.5 + 0.3 A, right to some 1e-7 of it: far more than the passes round
    for law, is_near in (("(1e9 + 0.3 * A - 1e9) + 0.5", False), ("0.3 * A + 0.5", True)):
        found = first_passage(closed(law), [2, 0], "B", 1)
        low, high = found.cdf_bounds([1.0])
        survived = -np.expm1(-1.1)
        assert low[0] <= survived <= high[0]
        assert (high[0] - low[0] < 1e-12) == is_near


def test_jumps_are_weighted_by_the_chance_that_they_come():
    for mean in (0.0, 0.06, 7.0, 3000.0):
        first, weights = poisson_window(mean, 1e-13)
        tails, exact = poisson_tails(first, weights, 1e-13), poisson.sf(np.arange(first + weights.size), mean)
        assert (tails >= exact * (1.0 - 1e-9)).all()
        assert abs(tails - exact).max() < 1e-12


def test_entries_of_one_place_round_one_by_one():
    """Twenty channels from A to B are twenty rates that are summed, not one that came so."""
    reactions = {f"turn{i}": ({"A": 1}, {"B": 1}) for i in range(20)}
    space = reachable(Network.from_reactions(reactions, np.full(20, 0.1)), [1, 0])
    assert DiscreteChain.of(space.transitions()).terms == 40
    assert Transient().solve(space.network, [1, 0], [1.0]).error > 40 * 2.0**-53
