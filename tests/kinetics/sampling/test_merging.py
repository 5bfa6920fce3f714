"""Merged channels: the sums of the propensities of their members, the same joint law, and members in their shares."""

import dataclasses

import numpy as np
import pytest
from break_studies import TANK, KnownBreaks, by_first_coefficient
from known_systems import assert_follows_table, line, network
from numpy.testing import assert_allclose, assert_array_equal
from sampled_networks import MIXED, PRODUCTS, THIRD_ORDER

from kinetics import Transient
from kinetics.network import Model, Network
from kinetics.rates.breaks import break_model
from kinetics.sampling import Direct, Lockstep, exposures_of_draws, sample_path, simulate_posterior
from kinetics.sampling import merging as merging_module
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.lockstep import LockstepSampler
from kinetics.sampling.merging import Merging

COLLIDING = by_first_coefficient(break_model("collision-wall"), {"alpha": 1.3, "wall": 40.0}, 1e-5).network(TANK)[1]
# Walls matter less here, and partners more.
CROWDED = by_first_coefficient(break_model("collision-wall"), {"alpha": 1.3, "wall": 0.5}, 1e-4).network(TANK)[1]
# One heavy body and a light one: its own weight may not be taken off the sum of all.
HEAVY = network(
    ("A", "B", "C"),
    {
        "A by A": ((2, 0, 0), (1, 0, 1)),
        "A by B": ((1, 1, 0), (0, 1, 1)),
        "A alone": ((1, 0, 0), (0, 0, 1)),
        "C by A": ((1, 0, 1), (2, 0, 0)),
        "C by B": ((0, 1, 1), (1, 1, 0)),
    },
    [1e9, 1e-7, 1e-9, 2.0, 0.5],
)
TWINS = network(
    ("A", "B"),
    {"one": ((2, 0), (0, 1)), "two": ((2, 0), (0, 1)), "back": ((0, 1), (2, 0)), "by A": ((1, 1), (3, 0))},
    [0.1, 0.3, 1.0, 0.0],
    "ordered",
)


def merged_propensities(merging, states, constants=None):
    """(n, G) as the definition says, in plain numpy."""
    model = merging.model(constants)
    values = []
    for counts in states:
        x = [*counts.astype(float), 1.0]
        part = 0.0
        for weight, species, taken, place in model.terms:
            part += weight * (x[int(species)] - taken)
            if place:
                assert place == len(x)
                x.append(part)
                part = 0.0
        x = np.array(x)
        plain = model.coefficients * x[model.first] * (x[model.second] - model.less)
        factors = np.append(counts, 1)[model.factors[:, :, 0]]
        general = (factors - model.factors[:, :, 1]) * (factors >= model.factors[:, :, 2])
        values.append(np.where(model.is_general, model.coefficients * general.prod(axis=1), plain))
    return np.array(values)


def members_summed(net, merging, states):
    return np.add.reduceat(net.propensities(states)[:, merging.members], merging.spans[:-1], axis=1)


@pytest.mark.parametrize(
    ("net", "n_merged", "n_sums"),
    [
        (COLLIDING, 8, 1),
        (HEAVY, 2, 2),
        (TWINS, 2, 2),
        (MIXED, 5, 1),
        (line(), 8, 0),
        (THIRD_ORDER, 3, 0),
        (PRODUCTS, 2, 0),
    ],
    ids=["collisions", "heavy", "twins", "mixed", "line", "third order", "products"],
)
def test_propensities_are_the_sums_of_the_members(net, n_merged, n_sums):
    merging = Merging.of(net)
    assert merging.representatives.size == n_merged == NetworkSize.of(net).n_merged
    assert np.count_nonzero(merging.model().terms[:, 3]) == n_sums
    rng = np.random.default_rng(1)
    states = np.concatenate([rng.integers(0, most, size=(300, len(net.species))) for most in (2, 4, 1000)])
    expected = members_summed(net, merging, states)
    assert_allclose(merged_propensities(merging, states), expected, rtol=1e-12)
    assert_array_equal(merged_propensities(merging, states) == 0, expected == 0)
    by_draw = Merging.of(net.with_rates(np.ones(len(net.channels))))
    assert_allclose(merged_propensities(by_draw, states, net.known_rates), expected, rtol=1e-12)
    for g in range(n_merged):
        mates = merging.members[merging.spans[g] : merging.spans[g + 1]]
        assert_array_equal(net.stoichiometry[mates], net.stoichiometry[[merging.representatives[g]] * mates.size])


def test_a_weight_that_differs_is_not_shared():
    constants = COLLIDING.known_rates.copy()
    constants[COLLIDING.channels.index("2->1+1 by trimer")] *= 1 + 1e-12
    assert np.count_nonzero(Merging.of(COLLIDING.with_rates(constants)).model().terms[:, 3]) == 2


def test_what_is_large_is_not_looked_through(monkeypatch):
    monkeypatch.setattr(merging_module, "MOST_CHANNELS", len(COLLIDING.channels) - 1)
    assert Merging.of(COLLIDING).representatives.size == len(COLLIDING.channels)


def test_representatives_are_found_once_a_network():
    other = COLLIDING.with_rates(COLLIDING.rate_constants)
    assert merging_module.representatives(COLLIDING) is merging_module.representatives(COLLIDING)
    assert merging_module.representatives(other) is not merging_module.representatives(COLLIDING)
    assert not merging_module.representatives(COLLIDING).flags.writeable
    known = len(merging_module._REPRESENTATIVES)
    del other
    assert len(merging_module._REPRESENTATIVES) == known - 1  # and not kept longer than it


FEW, END, RUNS = [5, 0, 1, 0], 900.0, 4000


def assert_exact(counts):
    exact = Transient().solve(CROWDED, FEW, [END])
    assert_follows_table(np.bincount(exact.space.index_of(counts), minlength=len(exact.space)), exact.probabilities[0])


def apart(net):
    """Its channels in lockstep, each on its own."""
    sampler = LockstepSampler(net)
    sampler.merging = Merging.of(net, np.arange(len(net.channels)))
    sampler.model, sampler.changes = sampler.merging.model(), net.stoichiometry
    return sampler


def test_the_joint_law_is_the_exact_one_merged_or_not(monkeypatch):
    merged = Lockstep().simulate(CROWDED, FEW, [END], RUNS, seed=41).counts[:, 0]
    assert_exact(merged)
    assert_array_equal(Direct().simulate(CROWDED, FEW, [END], RUNS, seed=41).counts[:, 0], merged)
    monkeypatch.setattr(Lockstep, "prepared", lambda self, net: apart(net))
    assert_exact(Lockstep().simulate(CROWDED, FEW, [END], RUNS, seed=42).counts[:, 0])


@pytest.mark.parametrize("wrong", [0, 3], ids=["less of a sum", "weight of a partner"])
def test_a_wrong_weight_is_seen(wrong, monkeypatch):
    """Controls that must fail: nothing taken off a sum, or one partner of twice the weight."""
    right = Merging.model

    def mutant(self, constants=None):
        model = right(self, constants)
        if wrong:
            model.terms[1, 0] *= 2
            return model
        return model._replace(less=np.where(model.second > self.n_species, 0.0, model.less))

    monkeypatch.setattr(Merging, "model", mutant)
    with pytest.raises(AssertionError, match="chi-square"):
        assert_exact(Lockstep().simulate(CROWDED, FEW, [END], RUNS, seed=41).counts[:, 0])


CATALYSED = Network.from_reactions(
    {
        "by B": ({"A": 1, "B": 1}, {"B": 1}),
        "other": ({"B": 1}, {"B": 1, "D": 1}),
        "by C": ({"A": 1, "C": 1}, {"C": 1}),
        "alone": ({"A": 1}, {}),
    },
    [0.2, 1.0, 0.1, 0.7],
)
SHARES = np.array([0.2 * 3, 0.1 * 5, 0.7]) / (0.2 * 3 + 0.1 * 5 + 0.7)


def test_members_fire_by_their_shares():
    start = np.zeros(len(CATALYSED.species), dtype=int)
    for name, copies in (("A", 3000), ("B", 3), ("C", 5)):
        start[CATALYSED.index(name)] = copies
    path = sample_path(CATALYSED, start, 30.0, seed=43)
    fired = np.bincount(path.channels, minlength=4)[[0, 2, 3]]
    assert fired.sum() == 3000
    assert_follows_table(fired, SHARES)
    with pytest.raises(AssertionError, match="chi-square"):
        assert_follows_table(fired, SHARES[[1, 0, 2]])


def test_paths_and_exposures_name_the_same_members():
    """The path itself refuses an event without its reactants; events are those of the exposures."""
    start = [40, 0, 0, 5]
    seen, _ = next(iter(exposures_of_draws(Model.of(COLLIDING, start), [COLLIDING.known_rates], 900.0, 5, seed=44)))
    for run in range(5):
        path = sample_path(COLLIDING, start, 900.0, seed=44, run=run)
        assert_array_equal(np.bincount(path.channels, minlength=len(COLLIDING.channels)), seen[run])
    assert np.count_nonzero(seen.sum(axis=0)) > 15


def test_draws_are_runs_of_the_network_with_their_constants():
    """Powers of two keep rounding the same in whichever order factors are taken."""
    constants = COLLIDING.known_rates * np.array([[1.0], [2.0], [0.5]])
    made = simulate_posterior(
        Model.of(COLLIDING, [40, 0, 0, 5]), constants, [300.0, 900.0], 20, seed=45, method=Lockstep()
    )
    for d, counts in enumerate(made):
        alone = Lockstep().simulate(
            COLLIDING.with_rates(constants[d]), [40, 0, 0, 5], [300.0, 900.0], 20, seed=45, first_run=20 * d
        )
        assert_array_equal(counts, alone.counts)


def test_weights_of_zero_break_nothing():
    silent = dataclasses.replace(KnownBreaks(break_model("collision"), {"alpha": 0.0}, (0.0,) * 4)).network(TANK)[1]
    counts = Lockstep().simulate(silent, [40, 0, 0, 0], [1e6], 20, seed=46).counts[:, 0]
    assert np.all(counts[:, 0] <= 1)
    assert_array_equal(counts @ [1, 2, 3, 4], 40)
