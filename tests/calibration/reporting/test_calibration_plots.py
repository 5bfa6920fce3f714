"""Figures show what the results hold; the numbers are tested elsewhere."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import Exposure, crossvalidate, diagnose, estimate, plots
from calibration.estimating.estimate import per_combination
from kinetics.rates import Rates
from kinetics.sampling import sample_path


def axes(n=1):
    made = [Figure().add_subplot() for _ in range(n)]
    return made[0] if n == 1 else made


def texts(ax):
    """All that is written on an axes; drawing it first finds layout errors."""
    ax.figure.draw_without_rendering()
    legend = ax.get_legend()
    labels = [text.get_text() for text in legend.get_texts()] if legend else []
    return [ax.get_xlabel(), ax.get_ylabel(), *labels, *(text.get_text() for text in ax.texts)]


def runs():
    network = line_network()
    restarted = restarted_run(network, network.state([14, 12, 6, 1]), 20.0, np.random.default_rng(0))
    return [restarted, breaking_run(network, network.state([0, 0, 10, 20]), 20.0, seed=0)]


def test_forest_of_rates_beside_references():
    ax = axes()
    references = {name: Rates.load(name) for name in ("table3", "table3_literal")}
    assert estimate(runs()).plot(ax, references=references) is ax
    assert texts(ax)[0] == "rate per combination of reactants, k N (1/tu)"
    assert set(texts(ax)[2:]) == {"measured, 95 % interval", "table3", "table3_literal"}
    assert [label.get_text() for label in ax.get_yticklabels()] == list(line_network().channels)
    assert ax.get_xscale() == "log"


def test_forest_says_what_was_not_seen_and_not_measured():
    calibrated = estimate([Exposure(line_network(), [5, 0, 1, 2, 3, 4, 7, 0], [9.0] * 7 + [0.0])])
    ax = axes()
    calibrated.plot(ax)
    assert "not measured" in texts(ax)
    single = axes()
    calibrated["1+2->3"].plot(single)
    assert texts(single)[0] == "rate constant k (1/tu)"


@pytest.mark.parametrize("name", ["table3", "table3_literal"])
def test_conventions_stand_on_one_scale(name):
    """With many copies, k N h is the same whether h or the scale counts the pairs."""
    known = Rates.load(name).apply(line_network())
    state = [10**7] * 4
    pairs = line_network().combinations_of(state)
    np.testing.assert_allclose(known.known_rates * per_combination(known) * pairs, known.propensities(state), rtol=1e-6)


def test_waits_and_groups():
    diagnosis = diagnose(runs())
    found = {result.title: result for result in diagnosis.results}
    ax = axes()
    assert found["any event: waits"].plot(ax) is ax
    assert texts(ax)[:2] == ["wait in units of its mean", "share still waiting"]
    assert ax.get_title() == "any event"
    ax = axes()
    found["2->1+1: age"].plot(ax)
    assert [label.get_text() for label in ax.get_yticklabels()] == ["0-2 tu", "2-10 tu", "after 10 tu"]
    ax = axes()
    found["1+2->3: drift"].plot(ax)
    assert texts(ax)[:2] == ["share of the integrated hazard", "share of the events"]
    ax = axes()
    found["all breaks: rebinding within 2 tu"].plot(ax)
    assert "not testable" in texts(ax)[-1]
    ax = axes()
    diagnosis.plot(ax)
    assert texts(ax)[2:] == ["if the model holds", f"{len(diagnosis.tested)} tests"]


def test_rebinding_beside_what_is_expected():
    full = [sample_path(line_network(), [60, 0, 0, 0], 20.0, seed=1, run=run) for run in range(3)]
    ax = axes()
    worst = diagnose(full).worst("rebinding")
    worst.plot(ax)
    assert texts(ax)[0] == "inverse joins within the window"
    assert ax.get_title() == worst.title.replace(": rebinding", "")


@pytest.mark.parametrize("end", [2.0, 40.0])  # with and without censored first times
def test_trajectories_and_first_times(end):
    held_out = [sample_path(line_network(), [30, 0, 0, 0], end, seed=1, run=i) for i in range(5)]
    found = crossvalidate(estimate(runs()).rates(), held_out, np.linspace(0, end, 9), "quadmer", 20, 99)
    made = axes(3)
    assert found.plot(made, ["dimer", "trimer", "quadmer"]) is made
    labels = texts(made[2])
    assert labels[:2] == ["time (tu)", "quadmer (copies, mean)"]
    assert labels[2:] == ["exact, 95 % band for 5 runs", "SSA, 20 runs", "mechanics, 95 % interval"]
    ax = axes()
    found.first.plot(ax)
    assert "mechanics, 5 runs, 95 % intervals" in texts(ax)
    assert ax.get_ylim() == (0.0, 1.0)
    ax = axes()
    found.single_runs.plot(ax)
    assert "95 % under the model" in texts(ax)


def test_event_ratios():
    ax = axes()
    expected = plots.Limited([100.0, 2.0, 0.0], [80.0, 0.0, 0.0], [120.0, 5.0, 0.0])
    assert plots.event_ratios(ax, ["joins", "breaks", "never"], [130, 0, 0], expected, "60 cubes") is ax
    assert texts(ax)[0] == "events seen / expected"
    assert texts(ax)[-3:] == ["130 / 100", "0 / 2.0", "0 / 0.0"]
    assert ax.get_xscale() == "log"
    left, right = ax.get_xlim()
    assert 0 < left < 0.8
    assert right > 1.3
