"""All diagnostics together: what is doubtful, how often, and in which words."""

import json

import numpy as np
import pytest
from doubtful_runs import CASES, t5_runs
from scipy.stats import binom, kstest
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import DIAGNOSTICS, Crowded, diagnose, fit_rates
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.diagnosing.renewal import waiting_times
from kinetics.rates import Rates


def tanks(network, rng, rates=(1.0, 1.0)):
    """Restarted runs from two compositions, the second with its own rate of 2+2->4, and a tank without bonding."""
    states = [network.state(s) for s in ([14, 12, 6, 1], [6, 20, 2, 2])]
    runs = []
    for state, rate in zip(states, rates, strict=True):
        other = network.with_rates(network.known_rates * np.where(np.arange(8) == 3, rate, 1.0))
        runs += [restarted_run(other, state, 20.0, rng) for _ in range(3)]
    return [*runs, breaking_run(network, network.state([0, 0, 10, 20]), 20.0, seed=6)]


def test_sound_runs_raise_no_doubt_and_a_faster_channel_does_by_name():
    network = line_network()
    sound = diagnose(tanks(network, np.random.default_rng(6)))
    assert sound.doubtful == []
    assert sound.verdict.startswith("No sign against the model in ")
    found = diagnose(tanks(network, np.random.default_rng(6), (1.0, 3.0)))
    assert "2+2->4: start" in found.doubtful
    assert all(name.startswith(("2+2->4", "any event", "all joins")) for name in found.doubtful)
    assert "The model is doubtful" in found.verdict
    (row,) = [row for row in found.verdicts() if row["test"] == "start"]
    assert "--break-model collision" in row["verdict"]
    assert {row["channel"] for row in found.p_values()} == {
        *network.channels,
        *("any event", "all joins", "all breaks"),
    }


def test_what_cannot_be_tested_says_why():
    """No event, one run, one composition, restarts: None in rows, nan in tables, and no share of the correction."""
    network = line_network()
    run = restarted_run(network, network.state([14, 12, 0, 0]), 2.0, np.random.default_rng(1))
    found = diagnose([run])
    reasons = {each.title: each.reason for each in found.results if each.p_value is None}
    assert reasons["4->2+2: runs"] == "it was closed or had no reactants in any run"
    assert reasons["1+1->2: runs"] == "only one run could fire it"
    assert reasons["1+1->2: start"] == "only one initial composition could fire it"
    assert reasons["1+1->2: size"] == "all runs that could fire it hold 38 cubes"
    assert "restarted" in reasons["all breaks: rebinding within 2 tu"]
    assert len(found.tested) + len(reasons) == len(found.results)
    assert all(0 < each.p_value <= 1 for each in found.tested)
    rows = json.loads(json.dumps(found.table(), allow_nan=False))
    assert {row["p"] for row in rows if row["seen"].startswith("not testable")} == {None}
    nothing = diagnose([breaking_run(network, network.state([1, 0, 0, 0]), 1.0, seed=1)])
    assert nothing.verdict == "Nothing could be tested: there are too few events or runs."
    assert nothing.doubtful == []
    with pytest.raises(ValueError, match="no runs to diagnose"):
        diagnose([])


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.validate] * (name == "waits"))  # seven seconds
        for name in CASES
        if name not in ("rebinding", "identity")
    ],
)
def test_each_has_its_size_and_power(name):
    """At 5 %: of 60 sound studies no more fail, of 15 doubtful ones no fewer, than a size of 5 % and a power of 70 %
    allow with 1e-6."""
    case, rng = CASES[name], np.random.default_rng(3)
    sound = sum(case.p_value(case.sound, rng) < 0.05 for _ in range(60))
    doubtful = sum(case.p_value(case.doubtful, rng) < 0.05 for _ in range(15))
    assert binom.sf(sound - 1, 60, 0.05) > 1e-6
    assert binom.cdf(doubtful, 15, 0.7) > 1e-6
    assert doubtful >= 3  # else the bound above would hold for a test that sees nothing


def test_half_of_the_runs_at_three_times_the_rates_in_25_channels():
    """Over 50 tests, so that a smallest p-value of 1 / 5000 could fail none; the control is sound."""
    rng = np.random.default_rng(4)
    found = diagnose(t5_runs((1.0, 3.0), rng, runs=20))
    assert len(found.tested) > 50
    assert "1+1->dimer.a: runs" in found.doubtful
    assert found.tested[0].p_value < 1e-8
    assert diagnose(t5_runs((1.0,), rng, runs=20)).doubtful == []


def assert_sound(studies):
    """Studies flagged at 1 % no more often than chance allows with 1e-6, and no p-value below 1e-6 in any."""
    assert binom.sf(sum(bool(study.doubtful) for study in studies) - 1, len(studies), 0.01) > 1e-6
    assert min(study.tested[0].p_value for study in studies) > 1e-6


def test_sound_assemblies_raise_no_doubt():
    """In 10 runs each, in which events use up the few copies of a species. The control is `drift` as it was, which
    took exposure as given: p = 0 for a channel whose only event was the last that could happen."""
    rng = np.random.default_rng(5)
    studies = [t5_runs((1.0,), rng, runs=10) for _ in range(8)]
    assert_sound([diagnose(runs) for runs in studies])
    judged = [DiagnosedRuns(tuple(runs)) for runs in studies]
    waits = [waiting_times(each, j) for each in judged for j in np.flatnonzero(each.events)]
    assert min(kstest(each.positions / each.total, "uniform").pvalue for each in waits) < 1e-6


@pytest.mark.validate
@pytest.mark.parametrize(("runs", "end"), [(40, 2000.0), (10, 500.0)])
def test_the_size_on_assemblies(runs, end):
    """In 40 sound studies of the T of five."""
    rng = np.random.default_rng(6)
    assert_sound([diagnose(t5_runs((1.0,), rng, runs, end)) for _ in range(40)])


@pytest.mark.validate
def test_the_bar_of_25_channels():
    """In 40 studies: flagged in at least 95 % (38)."""
    rng = np.random.default_rng(5)
    assert sum(bool(diagnose(t5_runs((1.0, 3.0), rng)).doubtful) for _ in range(40)) >= 38


def test_runs_are_judged_under_any_model():
    """A rate that grows with the crowd is doubtful under mass action and not under the crowded model; rates as
    predictions use them are mass action."""
    case, rng = CASES["crowd"], np.random.default_rng(6)
    runs = case.doubtful(rng)
    assert diagnose(runs, tests=[case.diagnostic]).results[0].p_value < 0.01
    fit = fit_rates(Crowded(), runs)
    assert diagnose(runs, fit, tests=[case.diagnostic]).results[0].p_value > 0.05
    network = line_network()
    paths = tanks(network, rng)
    judged = diagnose(paths, Rates.load("table3"))
    assert [each.p_value for each in judged.results if each.test == "drift"] == pytest.approx(
        [each.p_value for each in diagnose(paths).results if each.test == "drift"]
    )


def test_the_seed_gives_the_result():
    runs = tanks(line_network(), np.random.default_rng(7))
    first, again, other = (diagnose(runs, seed=seed).p_values() for seed in (1, 1, 2))
    np.testing.assert_equal(first, again)
    assert str(first) != str(other)
    assert len(DIAGNOSTICS) == 8
