"""What derivatives cost, in counted steps and solutions: no more for forty channels than for four."""

import numpy as np
import pytest
from known_systems import walk

from kinetics.markov import Chain, Sensitivity
from kinetics.markov.derivatives import forwards
from kinetics.native import linear, twins


class Counted:
    """Calls of a function, and a number that each adds."""

    def __init__(self, function, amount):
        self.function, self.amount, self.total = function, amount, 0

    def __call__(self, *arguments):
        self.total += self.amount(*arguments)
        return self.function(*arguments)


@pytest.fixture
def counted(monkeypatch):
    """Steps forwards and backwards; eliminations and substitutions."""
    found = {}
    for module, name, amount in (
        (twins, "retreat", lambda *arguments: arguments[-1].size),
        (twins, "powers", lambda moves, vectors: len(vectors) - 1),
        (twins, "steps_back", lambda moves, vectors, *rest: len(vectors)),
        (linear, "reduce", lambda *arguments: 1),
        (linear, "solve", lambda *arguments: 1),
        (linear, "occupy", lambda *arguments: 1),
    ):
        found[name] = Counted(getattr(module, name), amount)
        monkeypatch.setattr(module, name, found[name])
    return found


@pytest.mark.parametrize("places", [2, 20])
def test_a_pass_forwards_and_one_backwards(places, counted, monkeypatch):
    """Each takes as many steps as the answer, but for a block of them."""
    chain = Chain.of(walk(places), {"place0": 1})
    target = f"place{places} == 1"
    chain.until(target, by=30.0)
    steps = counted["retreat"].total
    kept = Sensitivity(chain).until(target, by=30.0)
    assert counted["retreat"].total == steps
    taken = counted["steps_back"].total
    assert 30 < taken < 1.3 * steps + 30
    assert counted["powers"].total == taken
    # from checkpoints, where vectors would take too much room: the steps forwards are made twice, to the same numbers
    monkeypatch.setattr(forwards, "KEPT_BYTES", 100)
    again = Sensitivity(chain).until(target, by=30.0)
    assert counted["powers"].total == 3 * taken
    assert np.array_equal(kept.value, again.value)


def test_states_that_do_not_matter_are_left_out(counted):
    """Of a line of places only those up to the target, however fast it goes on behind."""
    ahead = np.diag([1.0, 1.0, 1.0, 1e6, 1e6], 1)
    chain = Chain(ahead, 0)
    found = Sensitivity(chain, {"all": ahead > 0}).until(np.arange(6) == 3, by=2.0)
    assert 0 < counted["steps_back"].total < 300
    # the control: what comes behind matters to what is there at last
    Sensitivity(chain, {"all": ahead > 0}).means(np.eye(1, 6, 5), 2e-3)
    assert counted["steps_back"].total > 1500
    density = 2.0**2 / 2 * np.exp(-2.0)  # of three waits at 2
    assert found.value[0] == pytest.approx(2.0 * density, rel=1e-12)


@pytest.mark.parametrize("places", [2, 20])
def test_one_elimination_and_two_substitutions(places, counted):
    """Each substitution comes with those that prove it, as many as for the value alone."""
    chain = Chain.of(walk(places, down=0.5), {"place0": 1})
    chain.reward("place0", until=f"place{places} == 1")
    reduced, solved, occupied = (counted[name].total for name in ("reduce", "solve", "occupy"))
    assert (reduced, occupied) == (1, 0)
    Sensitivity(chain).passage(f"place{places} == 1")
    more = [counted[name].total for name in ("reduce", "solve", "occupy")]
    assert more[0] == 2 * reduced
    assert more[1] <= 2 * solved
    assert more[2] <= solved
    # the control: means of two functions share the pass forwards, and no more
    Sensitivity(chain).means(np.asarray(chain.counts, dtype=float).T[:2], 5.0)
    assert counted["steps_back"].total >= 2 * counted["powers"].total


def test_cycles_until_a_remote_target(counted):
    """Uphill, where rates fire two million times before: up to four eliminations more."""
    chain = Chain.of(walk(20), {"place0": 1})
    found = Sensitivity(chain).passage("place20 == 1")
    assert 3 <= counted["reduce"].total <= 5
    assert (found.high - found.low).max() < 1e-10 * found.answer.value
