"""Double breaks: seen where they were put in, and as many as chance gives where there are none."""

from dataclasses import replace

import numpy as np
import pytest
from break_studies import by_first_coefficient
from scipy.stats import poisson

from calibration.commands.tables import breaks_table
from calibration.estimating.break_comparison import BreakComparison
from calibration.estimating.break_fit import fit_breaks
from calibration.estimating.double_breaks import DoubleBreaks, double_breaks
from kinetics.rates.breaks import break_model
from kinetics.runs import RESTART, JumpPath

COLLISION = break_model("collision")
TRUTH = by_first_coefficient(COLLISION, {"alpha": 1.3}, 1e-5)
STEP = 1e-3


@pytest.fixture(scope="module")
def runs():
    return TRUTH.runs(40, 60.0, seed=11)


def doubled(path, share, rng):
    """Each break is followed, with this probability, by that of a dimer in the next step, whose monomers go nowhere."""
    network, rows = path.network, []
    dimer = network.channels.index("2->1+1")
    state = np.array(path.initial)
    for t, c in zip(path.times, path.channels, strict=True):
        needed = network.reactants[c]
        if (state < needed).any():
            continue  # its reactant was used up by a break that was put in
        state = state + network.stoichiometry[c]
        rows.append((t, c))
        if needed.sum() == 1 and state[1] > 0 and rng.uniform() < share and t + STEP < path.end:
            state = state + network.stoichiometry[dimer]
            rows.append((t, dimer))
    times, channels = zip(*rows, strict=True)
    return replace(path, times=np.array(times), channels=np.array(channels), partners=None)


def test_chance_is_as_expected_and_doubles_are_seen(runs):
    """Within 2 tu, where chance gives many; then doubles within a step, the control."""
    fit = fit_breaks(COLLISION, runs)
    by_chance = double_breaks(fit, runs, 2.0)
    assert by_chance.expected > 100
    assert poisson.sf(by_chance.seen - 1, by_chance.expected) > 1e-6
    assert poisson.cdf(by_chance.seen, by_chance.expected) > 1e-6
    few = double_breaks(fit, runs, 2 * STEP)
    assert few.expected < 2
    assert few.p_value > 1e-6
    rng = np.random.default_rng(0)
    made = [doubled(path, 0.08, rng) for path in runs]
    found = double_breaks(fit_breaks(COLLISION, made), made, 2 * STEP)
    assert found.p_value < 1e-6
    low, high = found.interval(1 - 1e-6)
    assert low < 0.08 < high < 0.16
    assert sum(found.pairs.values()) == found.seen
    assert all(second == "2->1+1" for (_, second), n in found.pairs.items() if n > 2)


def test_they_are_stated_beside_the_break_models(runs):
    """Only where the runs resolve them, and asked for only where they were put in."""
    few = runs[:8]
    assert BreakComparison.asked_for("collision", few).to_dict()["double_breaks"] is None
    rng = np.random.default_rng(0)
    for paths, is_asked_for in ((few, False), ([doubled(path, 0.2, rng) for path in few], True)):
        compared = BreakComparison.asked_for("collision", paths, within=2 * STEP)
        found = compared.to_dict()["double_breaks"]
        assert found["is_asked_for"] == is_asked_for
        assert found["sentence"] == compared.doubles.sentence
        assert f"{found['seen']} of {found['breaks']} breaks came within 0.002 tu" in found["sentence"]
        assert ("do not call for a model with double breaks" in found["sentence"]) != is_asked_for
        assert sum(pair["seen"] for pair in found["pairs"]) == found["seen"]
        assert f"double breaks: {found['sentence']}." in breaks_table(compared)
        assert found["low"] <= found["share"] <= found["high"]
    assert DoubleBreaks(STEP, 0, 0, 0.0, {}).sentence == "no bond broke"


def test_intervals_cover(request):
    """Of counts drawn at a known share; at most 5 % miss, with a false alarm of 1e-6."""
    rng, misses, n = np.random.default_rng(3), 0, 600
    for _ in range(n):
        firsts, expected = 200, 0.4
        seen = int(rng.binomial(firsts, 0.07) + rng.poisson(expected))
        low, high = DoubleBreaks(STEP, firsts + seen, seen, expected, {}).interval()
        misses += not low <= 0.07 <= high
    assert misses < 0.05 * n + 4.8 * np.sqrt(0.05 * 0.95 * n)
    assert misses > 0.01 * n  # nor are they far too wide


def test_variance_of_counts_in_pairs():
    """14 of 219 breaks in pairs: counts vary by 1 + 28 / 219."""
    found = DoubleBreaks(STEP, 219, 14, 0.0, {})
    assert "vary 1.13 [1.07, 1.20] times as much" in found.sentence
    assert found.variance_factor == pytest.approx(1 + 28 / 219)
    assert np.isnan(DoubleBreaks(STEP, 0, 0, 0.0, {}).share)
    assert DoubleBreaks(STEP, 0, 0, 0.0, {}).interval() == (0.0, 1.0)


def test_pairs_do_not_reach_across_restarts_and_ends(runs):
    network = runs[0].network
    single = network.channels.index("4->2+2")
    fit = fit_breaks(COLLISION, runs)
    times = [1.0, 1.0, 1.0 + STEP, 1.0 + STEP, 3.0]
    path = JumpPath(network, [0, 0, 0, 5], times, [single, RESTART, single, single, single], 3.0, tank=TRUTH.tank)
    found = double_breaks(fit, [path], 2 * STEP)
    assert (found.breaks, found.seen) == (4, 1)
    rate = [fit.integrated_hazards(path)[i].sum() / dt for i, dt in ((2, STEP), (4, 2.0 - STEP))]
    assert found.expected == pytest.approx(rate[1] * 2 * STEP, rel=1e-9)
    with pytest.raises(ValueError, match="within = 0; expected a time above 0"):
        double_breaks(fit, [path], 0)
    with pytest.raises(ValueError, match="level = 2"):
        found.interval(2)
