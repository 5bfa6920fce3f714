"""Results of calibration show themselves, and posteriors go to ArviZ."""

import sys
from functools import cache

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.stats import gamma, kstest
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import (
    BreakComparison,
    MassActionRates,
    crossvalidate,
    diagnose,
    estimate,
    fit_rates,
)
from calibration.estimating.break_comparison import rates_with_breaks
from kinetics.sampling import sample_path
from kinetics.support.shown import Shown

TIMES = np.array([0.0, 5.0, 10.0])


@cache
def paths():
    network = line_network()
    rng = np.random.default_rng(1)
    restarted = restarted_run(network, network.state([14, 12, 6, 1]), 60.0, rng)
    return restarted, breaking_run(network, network.state([0, 0, 12, 30]), 20.0, 4, 0)


@cache
def calibrated():
    return estimate(paths())


def held_out():
    return [sample_path(line_network(), [30, 0, 0, 0], TIMES[-1], seed=7, run=run) for run in range(4)]


@cache
def validated():
    rates = calibrated().rates()
    return crossvalidate(rates, held_out(), TIMES, "quadmer", groups=59, runs=20)


RESULTS = {
    "calibration": calibrated,
    "fit": lambda: fit_rates(MassActionRates(), paths()),
    "breaks": lambda: BreakComparison.of(paths()),
    "diagnosis": lambda: diagnose(paths()),
    "cross-validation": validated,
    "verdict": lambda: validated().verdict,
    "first times": lambda: validated().first,
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_a_line_a_table_and_html(name):
    result = RESULTS[name]()
    assert isinstance(result, Shown)
    assert repr(result) == f"<{type(result).__name__}: {result.headline}>"
    assert len(repr(result)) < 200
    assert "\n" not in repr(result)
    table = result.summary()
    assert table.rows
    assert {len(row) for row in table.rows} == {len(table.titles)}
    assert str(result) == table.text
    assert result._repr_html_().count("<tr>") == len(table.rows) + 1


def test_figures_need_no_axes():
    assert len(validated().plot()) == 4
    plt.close("all")


def test_draws_are_those_of_the_posterior_and_other_evidence_is_seen():
    found = calibrated().to_arviz(draws=500, chains=3, seed=2)
    rate = found.posterior["rate"]
    assert dict(rate.sizes) == {"chain": 3, "draw": 500, "channel": 8}
    for row in calibrated().estimates:
        draws = rate.sel(channel=row.channel).values.ravel()
        right = gamma(row.events + 0.5, scale=1.0 / row.exposure)
        assert kstest(draws, right.cdf).pvalue > 1e-6
        assert kstest(draws, gamma(row.events + 40.5, scale=1.0 / row.exposure).cdf).pvalue < 1e-6
    np.testing.assert_array_equal(found.constant_data["events"], [row.events for row in calibrated().estimates])
    again = calibrated().to_arviz(draws=500, chains=3, seed=2)
    np.testing.assert_array_equal(rate, again.posterior["rate"])
    assert (rate != calibrated().to_arviz(draws=500, chains=3, seed=3).posterior["rate"]).any()


def test_arviz_makes_its_table_of_them():
    import arviz

    table = arviz.summary(calibrated().to_arviz(draws=200), kind="stats", round_to="none")
    first = calibrated().estimates[0]
    mean = (first.events + 0.5) / first.exposure
    assert abs(table["mean"].iloc[0] - mean) < 5 * mean / np.sqrt((first.events + 0.5) * 800)


def test_shape_parameters_are_drawn_too():
    compared = BreakComparison.asked_for("collision-wall", paths())
    posterior = rates_with_breaks(calibrated(), compared).posterior(line_network())
    found = posterior.to_arviz(draws=200, chains=2).posterior
    shape = posterior.names[8:]
    assert shape
    assert set(found.data_vars) == {"rate", *shape}
    for name in shape:
        assert dict(found[name].sizes) == {"chain": 2, "draw": 200}
        assert float(found[name].std()) > 0


def test_a_missing_arviz_is_told_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "arviz", None)
    with pytest.raises(ModuleNotFoundError, match="needs arviz; install it by: pip install 'arviz>="):
        calibrated().to_arviz()


@pytest.mark.parametrize("wrong", [{"draws": 0}, {"chains": 0}, {"seed": -1}])
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ValueError, match="expected"):
        calibrated().to_arviz(**wrong)


def test_versions_of_arviz_from_1_on_get_a_tree(monkeypatch):
    """Its `from_dict` takes groups in one mapping, and there is no InferenceData; tried with version 1.3 by hand."""
    import types

    from kinetics.rates import inference

    seen = {}
    later = types.SimpleNamespace(from_dict=lambda groups, **how: seen.update(groups=groups, **how))
    monkeypatch.setattr(inference, "_arviz", lambda: later)
    inference.arviz_data({"k": [[1.0]]}, {"events": [2.0]}, {"channel": ["a"]}, {"events": ["channel"]}, {"seed": 3})
    assert seen == {
        "groups": {"posterior": {"k": [[1.0]]}, "constant_data": {"events": [2.0]}},
        "coords": {"channel": ["a"]},
        "dims": {"events": ["channel"]},
        "attrs": {"/": {"seed": 3}},
    }
