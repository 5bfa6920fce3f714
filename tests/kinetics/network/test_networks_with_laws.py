"""Laws in networks: shown and kept, checked, obeyed or refused by the methods and by the master equation."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Direct, FiniteStateProjection, Transient, first_passage, reachable, solve, stationary
from kinetics.network import Network
from kinetics.network.laws import (
    Event,
)
from kinetics.rates import Rates
from kinetics.sampling import SAMPLING_METHODS, Auto, General

LAW = "k * A * (1 + 0.5 * sin(2 * pi * t / 24))"
BIRTH_DEATH = {"up": ({}, {"A": 1}), "down": ({"A": 1}, {})}


def test_a_network_shows_its_laws_and_keeps_them():
    net = Network.from_reactions(
        BIRTH_DEATH, [LAW, 0.5], parameters={"k": 3.0}, events=[Event("dose", "t >= 5", {"A": 9})], time_unit="min"
    )
    text = str(net)
    assert f"[{LAW}  (k = 3)]" in text
    assert "dose: when t >= 5: A = 9" in text
    assert "k, or law (1/min)" in text
    assert "t &gt;= 5" in net._repr_html_()
    assert "2 * [k * A" in str(net.with_rates([2.0, 0.5]))
    plain = Network.from_reactions(BIRTH_DEATH, [1.0, 0.5])
    others = [net, plain, Network.from_reactions(BIRTH_DEATH, [LAW, 0.5], parameters={"k": 4.0})]
    assert len({other.fingerprint for other in others}) == 3
    channels = {"up": {"rate": 2.0, "ways": 1}, "down": {"rate": 1.0, "ways": 1}}
    rates = {"convention": {"combinations": "distinct"}, "channels": channels}
    known = Rates(**rates).apply(net)
    assert known.laws == net.laws
    assert known.events == net.events
    assert_allclose(known.propensities([4], 6.0), [2 * 3 * 4 * 1.5, 4.0])


@pytest.mark.parametrize(
    ("rates", "rest", "message"),
    [
        (["q * A", 1.0], {}, "law of channel 'up': unknown name 'q' at column 1 of 'q \\* A'; the species are A"),
        (["k +", 1.0], {}, "law of channel 'up': cannot read"),
        (["A * 2", 1.0], {"parameters": {"A": 1.0}}, "both a species and a parameter; rename one"),
        (["A", 1.0, 2.0], {}, "3 rates or laws came; expected one for each of 2 channels"),
        (["A", -1.0], {}, "rate_constants holds -1.0"),
        ("AA", {}, "rates are 'AA'; expected a sequence, one rate constant or law a channel"),
        ([1.0, 1.0], {"events": ["dose"]}, "expected a sequence of kinetics.network.laws.Event"),
        (["A", 1.0], {"at_zero": "ignore"}, "at_zero = 'ignore'; expected one of block, refuse"),
        ([1.0, 1.0], {"events": [Event("e", "Q > 1", {"A": 1})]}, "event 'e': unknown name 'Q'"),
        ([1.0, 1.0], {"events": [Event("e", "A > 1", {"Q": 1})]}, "event 'e' sets 'Q'; the species are A"),
        ([1.0, 1.0], {"events": 2 * [Event("e", "A > 1", {"A": 1})]}, "events has 'e' twice"),
    ],
)
def test_bad_networks_with_laws(rates, rest, message):
    with pytest.raises(ValueError, match=message):
        Network.from_reactions(BIRTH_DEATH, rates, **rest)


def test_laws_for_channels_that_are_not_there():
    with pytest.raises(ValueError, match="a law for channel 'sideways', which the network does not have"):
        Network(("A",), ("up",), [[0]], [[1]], [1.0], [1.0], laws={"sideways": "A"})


def test_missing_reactants_block_or_refuse_as_declared():
    """Consumption at a constant rate: from 3 copies, no fourth event."""
    reactions = {"use": ({"A": 1}, {})}
    blocked = Network.from_reactions(reactions, ["2.0"])
    assert_array_equal(blocked.propensities([[0], [1], [9]]), [[0.0], [2.0], [2.0]])
    assert_array_equal(General().simulate(blocked, [3], [100.0], runs=50).counts, 0)
    assert len(reachable(blocked, [3])) == 4
    refused = Network.from_reactions(reactions, ["2.0"], at_zero="refuse")
    message = "the law of channel 'use', 2.0, is 2 at A = 0, where its reactants are missing"
    with pytest.raises(ValueError, match=message):
        General().simulate(refused, [3], [100.0], runs=50)
    with pytest.raises(ValueError, match=message):
        Transient().solve(refused, [3], [1.0])
    fine = Network.from_reactions(reactions, ["2.0 * (A > 0)"], at_zero="refuse")
    assert_array_equal(General().simulate(fine, [3], [100.0], runs=50).counts, 0)
    # A timed law, and two copies needed.
    timed = Network.from_reactions({"use": ({"A": 2}, {})}, ["1 + sin(t)"])
    assert_array_equal(General().simulate(timed, [5], [200.0], runs=50).counts, 1)


def test_the_master_equation_reads_laws():
    """A queue with one server and 7 places: detailed balance in closed form, and a space that the law closes."""
    net = Network.from_reactions(BIRTH_DEATH, ["piecewise(3, A < 7, 0)", "4"])
    exact = 0.75 ** np.arange(8) / (0.75 ** np.arange(8)).sum()
    law = stationary(net, [0])
    assert len(law.space) == 8
    assert_allclose(law.probabilities[np.argsort(law.space.states[:, 0])], exact, rtol=1e-13)
    late = solve(net, Transient(), [0], [200.0])
    assert_allclose(late.probabilities[0], exact[late.space.states[:, 0]], rtol=1e-9)
    projected = solve(net, FiniteStateProjection(), [0], [1.5])
    assert_allclose(projected.mean(), solve(net, Transient(), [0], [1.5]).mean(), rtol=1e-9)


@pytest.mark.parametrize("solver", [Transient(), FiniteStateProjection()], ids=lambda solver: solver.name)
def test_the_master_equation_refuses_time_and_events(solver):
    timed = Network.from_reactions(BIRTH_DEATH, ["1 + sin(t)", 1.0])
    with pytest.raises(ValueError, match=r"law of channel 'up', 1 \+ sin\(t\), depends on the time.*wellmixed scan"):
        solver.solve(timed, [0], [1.0])
    with pytest.raises(ValueError, match=r"the network has events \(dose\)"):
        solver.solve(
            Network.from_reactions(BIRTH_DEATH, [1.0, 1.0], events=[Event("dose", "t > 1", {"A": 1})]), [0], [1.0]
        )


def test_bad_laws_are_named_in_the_master_equation():
    net = Network.from_reactions(BIRTH_DEATH, ["3.5 - A", 1.0])
    with pytest.raises(ValueError, match=r"law of channel 'up', 3\.5 - A, is -0\.5 at A = 4; expected a finite number"):
        Transient().solve(net, [0], [1.0])
    # Up to 4 it holds: mean of the passage by the recursion of birth and death.
    waits = [1 / 3.5]
    for n in (1, 2, 3):
        waits.append((1 + n * waits[-1]) / (3.5 - n))
    assert first_passage(net, [0], "A", 4).mean == pytest.approx(sum(waits), rel=1e-12)


def test_quick_methods_refuse_and_auto_takes_the_general_one():
    net = Network.from_reactions(BIRTH_DEATH, ["2", 1.0])
    dosed = Network.from_reactions(BIRTH_DEATH, [2.0, 1.0], events=[Event("dose", "t > 1", {"A": 1})])
    quick = [method() for method in SAMPLING_METHODS if not method.takes_rate_laws]
    assert Direct() in quick
    for method in quick:
        with pytest.raises(ValueError, match=r"a rate law for channel 'up'; the method .* takes mass action only"):
            method.simulate(net, [0], [1.0], runs=2)
        with pytest.raises(ValueError, match=r"has event 'dose'; the method .* takes mass action only"):
            method.simulate(dosed, [0], [1.0], runs=2)
    assert Auto().choose(net) == Auto(many=False).choose(dosed) == General()
