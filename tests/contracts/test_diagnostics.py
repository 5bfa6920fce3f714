"""What every diagnostic of runs must do, so that a new one is tested by its line in `DIAGNOSTICS`."""

import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.stats import binom
from synthetic_runs import breaking_run, line_network, restarted_run
from used_up import used_up_run

from calibration import DIAGNOSTICS, MassActionRates, diagnose, fit_rates
from calibration.estimating.diagnosing.between_runs import BetweenRuns
from kinetics.network import Network
from kinetics.runs import JumpPath
from kinetics.sampling import sample_path

TWO_WAYS = Network(
    ("A", "B"),
    ("join", "break"),
    [[2, 0], [0, 1]],
    [[-2, 1], [2, -1]],
    [4, 1],
    [0.01, 0.2],
    conserved={"cubes": [1, 2]},
)


def full_runs(rng, n=4):
    """Runs of two sizes from single pieces, which break and join again."""
    return [sample_path(TWO_WAYS, [20 + 10 * (i % 2), 0], 20.0, seed=int(rng.integers(2**31))) for i in range(n)]


@pytest.fixture(params=DIAGNOSTICS, ids=lambda test: test.name)
def test(request):
    return request.param


@pytest.fixture(scope="module")
def paths():
    """Full, restarted, and without bonding."""
    network, rng = line_network(), np.random.default_rng(1)
    full = [sample_path(network, [40 + 20 * i, 0, 0, 0], 20.0, seed=1, run=i) for i in range(2)]
    restarted = [restarted_run(network, network.state([14, 12, 6, 1]), 10.0, rng) for _ in range(2)]
    return [*full, *restarted, breaking_run(network, network.state([0, 0, 10, 20]), 10.0, seed=1)]


def judged(test, runs, **given):
    return diagnose(runs, tests=[test], **given).results


def test_is_named_and_says_what_it_asks_and_sees(test):
    assert [each.name for each in DIAGNOSTICS].count(test.name) == 1
    assert len(type(test).__doc__) > 80
    assert test.question.endswith("?")
    for word in ("size", "power", "%", "events"):
        assert word in test.measured


def test_every_channel_has_a_result_or_a_reason(test, paths):
    results = judged(test, paths)
    assert len({each.title for each in results}) == len(results)
    for each in results:
        assert each.test == test.name
        if each.p_value is None:
            assert each.reason
        else:
            assert 0 < each.p_value <= 1
            assert np.isfinite(each.statistic)
            assert each.seen
            assert each.remedy
            assert not each.reason
    json.dumps([each.row() for each in results], allow_nan=False)


def test_silence_is_not_agreement(test):
    """Without events no p-value, and never p = 1."""
    idle = JumpPath(TWO_WAYS, [9, 9], [], [], 5.0)
    for each in judged(test, [idle, idle]):
        assert each.p_value is None
        assert each.reason


def test_results_are_drawn(test, paths):
    for each in judged(test, paths)[::3]:
        ax = Figure().add_subplot()
        assert each.plot(ax) is ax
        ax.figure.draw_without_rendering()


def test_the_size_of_a_rate_does_not_matter(test, paths):
    """Only the shape of the hazard is judged: mass action, fitted or not, and other ways give the same."""
    rows = [each.p_value for each in judged(test, paths)]
    fitted = [each.p_value for each in judged(test, paths, fit=fit_rates(MassActionRates(), paths))]
    np.testing.assert_allclose(np.array(fitted, float), np.array(rows, float), rtol=1e-6)
    network = replace(paths[0].network, ways=paths[0].network.ways * np.arange(1.0, 9.0))
    others = [replace(path, network=network) for path in paths]
    np.testing.assert_allclose(
        np.array([each.p_value for each in judged(test, others)], float), np.array(rows, float), rtol=1e-6
    )


def test_sound_runs_fail_as_often_as_they_may(test):
    """At 5 %, of 40 studies, within 1e-6; each study counted by its first result that could be had."""
    rng = np.random.default_rng(2)
    found = [next(e.p_value for e in judged(test, full_runs(rng)) if e.p_value is not None) for _ in range(40)]
    assert binom.sf(sum(p < 0.05 for p in found) - 1, len(found), 0.05) > 1e-6
    assert len(set(found)) > 10  # control: it does look at the runs


def failures_where_events_end_exposure(test):
    """Of 30 studies of runs that are over with their few reactants: how many fail at 5 %, of how many tested."""
    rng = np.random.default_rng(3)
    studies = [judged(test, [used_up_run(rng, copies=1 + i % 2) for i in range(20)]) for _ in range(30)]
    found = [p[0] for p in ([e.p_value for e in study if e.p_value is not None] for study in studies) if p]
    return sum(p < 0.05 for p in found), len(found)


def test_an_event_may_use_up_its_reactant(test):
    """Such runs are sound: no more fail than chance allows with 1e-6."""
    failed, n = failures_where_events_end_exposure(test)
    assert binom.sf(failed - 1, n, 0.05) > 1e-6


def test_taking_exposure_as_given_fails_them():
    """Control: runs compared by Pearson's chi-square."""

    class Pearsons(BetweenRuns):
        by_expected = True

    failed, n = failures_where_events_end_exposure(Pearsons())
    assert binom.sf(failed - 1, n, 0.05) < 1e-6
