"""Numbers of a fit that have a closed form: tests, limits, tables, labels; and what a fit refuses."""

import numpy as np
import pytest
from break_studies import TANK
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from scipy.stats import chi2
from synthetic_models import pair_network, standing
from synthetic_runs import line_network

from calibration import MassActionRates, Weibull, compare_fits, fit_rates
from calibration.estimating.break_rates import BreaksBySpecies
from calibration.estimating.likelihood import RIDGE, SCATTERED, Evidence
from calibration.estimating.rate_fit import _crossing
from calibration.estimating.shape_search import least
from kinetics.network import Tank
from kinetics.rates.breaks import break_model, pairs
from kinetics.runs import BY_WALL, NO_BREAK, JumpPath

# Five joins and two breaks; 4 ways * 6 pairs at first.
PATH = JumpPath(pair_network(), [4, 1], [0.5, 1.0, 2.0, 2.5], [0, 1, 0, 1], 4.0)
UNEQUAL = JumpPath(pair_network(), [9, 3], [0.1, 0.3, 0.35, 0.9, 1.4], [0, 0, 1, 0, 1], 2.0)


def exposure_of(path):
    """(R,) by the definition."""
    waits = np.diff([0.0, *path.times, path.end])
    return path.network.ways * (waits @ path.network.combinations_of(path.states))


def log_likelihood(events, exposure, k):
    """Of mass action without what no constant changes."""
    return sum(n * np.log(x) - e * x for n, e, x in zip(events, exposure, k, strict=True) if n)


def test_profile_and_limits_of_a_constant_are_those_of_a_poisson_likelihood():
    fit = fit_rates(MassActionRates(), [UNEQUAL])
    events, exposure = np.bincount(UNEQUAL.channels), exposure_of(UNEQUAL)
    best = events / exposure
    assert_allclose(fit.best.coefficients[0], best, rtol=1e-14)
    for level in (0.5, 0.95, 0.999):
        low, high = fit.interval("k join", level)
        for limit in (low, high):
            lost = log_likelihood(events[:1], exposure[:1], best[:1])
            lost -= log_likelihood(events[:1], exposure[:1], [limit])
            assert 2 * lost == pytest.approx(chi2.ppf(level, 1), rel=1e-6)
            assert fit.profile("k join", limit) == pytest.approx(fit.log_likelihood - lost, abs=1e-9)
        assert low < best[0] < high
    for level in (0.0, 1.0, -0.5):
        with pytest.raises(ValueError, match="between 0 and 1"):
            fit.interval("k join", level)
    with pytest.raises(ValueError, match="unknown parameter 'k split'"):
        fit.interval("k split")
    with pytest.raises(ValueError, match="unknown parameter 'k split'"):
        fit.profile("k split", 1.0)


def test_a_constant_that_nothing_measured_may_be_anything():
    lonely = standing(pair_network(), [1, 0])
    fit = fit_rates(MassActionRates(), [lonely])
    assert np.isnan(fit.parameters["k join"])
    assert fit.interval("k join") == (0.0, np.inf)
    assert fit.free_parameters == 0
    row = fit.table()[0]
    assert (row["parameter"], row["events"], row["low"], row["high"]) == ("k join", 0, 0.0, np.inf)
    assert row["note"] == "not measured"
    assert fit.integrated_hazards(lonely).tolist() == [[0.0, 0.0]]


def test_ratio_of_likelihoods_and_aic_by_hand():
    paths = [PATH, UNEQUAL]
    large, small = fit_rates(Weibull(), paths), fit_rates(MassActionRates(), paths)
    test = large.test_against(small)
    assert test.statistic == pytest.approx(2 * (large.log_likelihood - small.log_likelihood), rel=1e-12)
    assert test.statistic > 0.01
    assert (test.freedom, test.p_value) == (1, pytest.approx(chi2.sf(test.statistic, 1)))
    assert small.aic == 2 * 2 - 2 * small.log_likelihood
    assert large.aic == 2 * 3 - 2 * large.log_likelihood
    held = fit_rates(Weibull(), paths, fixed={"kappa": 1.0})
    assert held.free_parameters == 2
    assert held.interval("kappa") == (1.0, 1.0)
    assert held.log_likelihood == pytest.approx(small.log_likelihood, rel=1e-12)
    assert [row["note"] for row in held.table()] == ["", "", "held"]
    rows = compare_fits([small, large])
    assert min(row["aic_above_least"] for row in rows) == 0
    assert max(row["aic_above_least"] for row in rows) == pytest.approx(abs(small.aic - large.aic))
    with pytest.raises(ValueError, match="expected the smaller model"):
        small.test_against(large)
    with pytest.raises(ValueError, match="expected the smaller model"):
        held.test_against(small)
    for other in (fit_rates(MassActionRates(), paths[::-1]), fit_rates(MassActionRates(), paths, ["join"])):
        with pytest.raises(ValueError, match="other paths or channels"):
            large.test_against(other)


def test_a_score_is_the_likelihood_of_other_paths():
    fit = fit_rates(MassActionRates(), [UNEQUAL])
    h = PATH.network.ways * PATH.network.combinations_of(PATH.states)
    k = fit.best.coefficients[0]
    rates = h[np.arange(4), PATH.channels] * k[PATH.channels]
    assert fit.score([PATH]) == pytest.approx(np.log(rates).sum() - exposure_of(PATH) @ k, rel=1e-12)
    hazards = fit.integrated_hazards(PATH)
    assert_allclose(hazards, np.diff([0.0, *PATH.times, PATH.end])[:, None] * h * k, rtol=1e-12)


def test_the_plot_says_what_is_drawn():
    fit = fit_rates(Weibull(), [PATH, UNEQUAL])
    ax = fit.plot(Figure().add_subplot(), 0.9)
    assert ax.get_legend_handles_labels()[1] == ["estimate, 90 % interval"]
    usual = fit.plot(Figure().add_subplot())
    assert usual.get_legend_handles_labels()[1] == ["estimate, 95 % interval"]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["k join", "k break"]
    assert ax.get_title() == f"weibull, kappa = {fit.parameters['kappa']:.3g}"


def test_what_a_fit_refuses():
    other = standing(line_network(), [4, 0, 0, 0])
    for paths, options, said in (
        ([], {}, "no runs to fit"),
        ([PATH, other], {}, "two networks"),
        ([PATH], {"channels": ["split"]}, "unknown channel 'split'"),
        ([PATH], {"channels": []}, "expected one or more, each once"),
        ([PATH], {"channels": ["join", "join"]}, "expected one or more, each once"),
        ([PATH], {"fixed": {"kappa": 1.0}}, "unknown shape parameter 'kappa'; mass-action has none"),
    ):
        with pytest.raises(ValueError, match=said):
            fit_rates(MassActionRates(), paths, **options)
    (kappa,) = Weibull().shape
    for edge, factor in ((kappa.low, 0.999), (kappa.high, 1.001)):
        fit_rates(Weibull(), [PATH], fixed={"kappa": edge})
        with pytest.raises(ValueError, match=r"kappa = .*; expected"):
            fit_rates(Weibull(), [PATH], fixed={"kappa": edge * factor})


def test_two_terms_share_an_event_by_hand():
    """One event at 1 + 3 k, an exposure of 2: log(1 + 3 k) - 2 k is highest at k = 1/6, at 0 where k can only cost."""
    evidence = Evidence(np.array([[1.0, 3.0]]), np.array([0.7, 2.0]))
    best, value = evidence.mle_with({0: 1.0})
    assert_allclose(best, [1.0, 1 / 6], rtol=1e-8)
    assert value == pytest.approx(np.log(1.5) - 0.7 - 1 / 3, rel=1e-12)
    costly = Evidence(np.array([[1.0, 3.0]]), np.array([0.7, 4.0]))
    assert_allclose(costly.mle_with({0: 1.0})[0], [1.0, 0.0], atol=1e-12)
    # Together: the second explains the event at 3 / 2 of a unit, the first at 1 / 0.7, which is less.
    assert_allclose(evidence.mle[0], [0.0, 0.5], atol=1e-8)
    assert evidence.mle[1] == pytest.approx(np.log(1.5) - 1.0, rel=1e-9)
    assert RIDGE < 1e-8
    unmeasured = Evidence(np.zeros((0, 2)), np.array([0.0, 2.0]))
    assert np.isnan(unmeasured.mle[0][0])
    assert unmeasured.mle[0][1] == unmeasured.mle[1] == 0.0
    impossible = Evidence(np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([1.0, 1.0]))
    assert impossible.mle[1] == -np.inf


def test_where_a_falling_function_crosses_zero():
    for step, bound, expected in ((0.1, 10.0, 3.0), (-0.1, -10.0, -3.0), (7.0, 10.0, 3.0), (0.1, 2.0, 2.0)):
        assert _crossing(lambda x: 9.0 - x * x, 0.0, bound, step) == pytest.approx(expected, rel=1e-7)
    tried = []
    _crossing(lambda x: tried.append(x) or 1.0, 0.0, 8.0, 1.0)
    assert tried == [1.0, 2.0, 4.0, 8.0]  # twice as far each time, and the bound last


def test_pairs_are_those_of_the_tank_of_the_coefficients():
    """A tank twice as large has half as many of each pair, and a wall by its surface over its volume."""
    model, network, larger = break_model("collision-wall"), line_network(), Tank((4.0, 2.0, 3.0))
    path = JumpPath(network, [5, 4, 3, 2], [], [], 1.0, tank=larger)
    plain = pairs(network, model, path.states)
    scaled = BreaksBySpecies.of(model, network, TANK).combinations(path)
    names = model.partners(network)
    wall = (larger.surface / larger.volume) / (TANK.surface / TANK.volume)
    for name, one, other in zip(names, scaled, plain, strict=True):
        assert_allclose(one, other * (wall if name == "wall" else TANK.volume / larger.volume))
    assert len(names) == 5
    for rates, watched in (
        (BreaksBySpecies.of(model, network, larger), path),
        (BreaksBySpecies.of(model, network, None), path),
        (BreaksBySpecies.of(model, network, TANK), JumpPath(network, [5, 4, 3, 2], [], [], 1.0)),
        (BreaksBySpecies.of(model, network, None), JumpPath(network, [5, 4, 3, 2], [], [], 1.0)),
    ):
        for one, other in zip(rates.combinations(watched), plain, strict=True):
            assert_allclose(one, other)


def test_partners_count_only_where_they_are_asked_for_and_known():
    model, network = break_model("collision-wall"), line_network()
    channel = network.channels.index("2->1+1")
    path = JumpPath(network, [5, 4, 3, 2], [0.5], [channel], 1.0, partners=np.array([BY_WALL]))
    asked = BreaksBySpecies.of(model, network, None, by_partner=True)
    by_trimer = JumpPath(network, [5, 4, 3, 2], [0.5], [channel], 1.0, partners=np.array([2]))
    unnamed = JumpPath(network, [5, 4, 3, 2], [0.5], [channel], 1.0)
    names = model.partners(network)
    for rates, run, allowed in (
        (BreaksBySpecies.of(model, network, None), path, names),
        (asked, unnamed, names),
        (asked, path, ("wall",)),
        (asked, by_trimer, ("trimer",)),
    ):
        (parts,) = rates.collected(run, np.array([0]))[1]
        assert tuple(name for name, part in zip(names, parts, strict=True) if part > 0) == allowed
    assert asked.cache_key != BreaksBySpecies.of(model, network, None).cache_key
    moved = asked.with_shape({"wall": 7.0})
    assert (moved.shape_values["wall"], moved.by_partner) == (7.0, True)
    assert moved.cache_key == asked.cache_key
    assert moved.mixture().shape == (1, 5)
    assert NO_BREAK != BY_WALL


def test_shapes_are_scattered_only_where_they_cost_no_pass_over_the_paths(monkeypatch):
    asked = []

    def noted(free, start, costs, scattered):
        asked.append((len(free), scattered))
        return least(free, start, costs, scattered)

    monkeypatch.setattr("calibration.estimating.likelihood.least", noted)
    network, model = line_network(), break_model("collision")
    channel = network.channels.index("2->1+1")
    path = JumpPath(network, [5, 4, 3, 2], [0.5], [channel], 1.0)
    fit = fit_rates(BreaksBySpecies.of(model, network, None), [path], ["2->1+1"])
    fit.profile("alpha", 1.0)  # nothing is free
    fit.profile("b 2->1+1", 0.1)  # from the shape that is known
    fit_rates(Weibull(), [PATH])
    assert asked == [(1, SCATTERED), (0, 0), (1, 0), (1, 0)]
