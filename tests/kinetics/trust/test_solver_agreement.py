"""Solvers are held against each other within their stated errors; wrong ones are seen."""

import json
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from known_systems import network, switch
from verified_networks import FEW

from kinetics import Dense, FiniteStateProjection, Network, Transient
from kinetics.markov.transient import SOLVING_METHODS
from kinetics.trust import compare_solvers


@dataclass(frozen=True)
class Wrong(Transient):
    """The exact solution of a network whose first rate is a little off, or with its last time repeated."""

    name: ClassVar[str] = "wrong"

    off: float = 0.0
    stops: bool = False

    def distribution(self, network, start, grid):
        constants = network.known_rates.copy()
        constants[0] *= 1 + self.off
        found = super().distribution(network.with_rates(constants), start, grid)
        if not self.stops:
            return found
        return replace(found, probabilities=np.repeat(found.probabilities[:1], grid.size, axis=0))


@pytest.mark.parametrize(("net", "initial", "times"), [case[1:] for case in FEW], ids=[case[0] for case in FEW])
def test_solvers_agree_within_their_errors(net, initial, times):
    found = compare_solvers(net, initial, times)
    assert found.failures == (), str(found)
    assert found.refusals == ()
    assert len(found.pairs) == len(SOLVING_METHODS) * (len(SOLVING_METHODS) + 1) // 2
    assert all(pair.is_bound for pair in found.pairs)
    assert max(pair.allowed for pair in found.pairs) < 1e-8  # or anything would agree


def test_a_wrong_solver_is_seen():
    """A rate wrong by 1e-9 is far more than the errors that are stated."""
    right = compare_solvers(switch(), [20, 0], [0.5, 2.0], [Transient(), Wrong(), Dense()])
    assert right.failures == ()
    found = compare_solvers(switch(), [20, 0], [0.5, 2.0], [Transient(), Wrong(off=1e-9), Dense()])
    assert {(pair.first, pair.second) for pair in found.failures} == {("transient", "wrong"), ("wrong", "dense")}
    assert "WRONG" in str(found)
    data = json.loads(json.dumps(found.to_json()))
    assert sum(not pair["agrees"] for pair in data["pairs"]) == 2


def test_a_solver_that_contradicts_itself_is_seen():
    found = compare_solvers(switch(), [20, 0], [0.5, 2.0], [Wrong(stops=True)])
    assert [pair.second for pair in found.failures] == ["itself, from time to time"]


def test_refusals_and_estimates_are_said():
    net = network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [10.0, 1.0])
    found = compare_solvers(net, [0], [1.0, 2.0], [FiniteStateProjection(), Transient(max_states=100)])
    assert [name for name, _ in found.refusals] == ["transient"]
    assert "transient gave no answer: over 100 states" in str(found)
    for law, is_bound in (("X / (1 + X)", True), ("floor(X / 3 * 3) / (1 + X)", False)):
        by_law = Network.from_reactions({"death": ({"X": 1}, {})}, [law])
        found = compare_solvers(by_law, [9], [1.0, 2.0])
        assert found.failures == ()
        assert {pair.is_bound for pair in found.pairs} == {is_bound}
        assert ("(estimate)" in str(found)) != is_bound
    with pytest.raises(ValueError, match="no solver supports the network"):
        compare_solvers(net, [0], [1.0], [Transient(max_states=100)])
