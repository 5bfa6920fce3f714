"""Models of rates beyond their contract: closed forms, several shapes, tests with their size and power."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import kstest
from synthetic_models import drawn_path, known_parameters, pair_network, standing
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import (
    Crowded,
    MassActionRates,
    RateModel,
    ShapeParameter,
    Weibull,
    compare_fits,
    count,
    estimate,
    fit_rates,
)
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.diagnosing.renewal import waiting_times
from kinetics.runs import JumpPath
from kinetics.sampling import sample_path

STATES = ([8, 2], [3, 9])


def line_runs():
    network, rng = line_network(), np.random.default_rng(0)
    return [
        restarted_run(network, network.state([14, 12, 6, 1]), 20.0, rng),
        breaking_run(network, network.state([0, 0, 10, 20]), 20.0, seed=0),
        sample_path(network, [60, 0, 0, 0], 50.0, seed=1),
    ]


def pair_runs(model, coefficients, rng, n=4, end=8.0):
    return [drawn_path(model, coefficients, pair_network(), STATES[i % 2], end, rng) for i in range(n)]


@dataclass(frozen=True)
class Halves(RateModel):
    """One constant where the first species has many copies, another where it has few: two closed forms in one."""

    name = "halves"
    terms = ("many", "few")

    def combinations(self, path):
        h = path.network.combinations_of(path.states)
        is_many = path.states[:, :1] > 5
        return [h * is_many, h * ~is_many]


@dataclass(frozen=True)
class TwoPowers(RateModel):
    """Powers of the counts of both species: two shape parameters, looked for together."""

    a: float = 0.0
    b: float = 0.0

    name = "two-powers"
    shape = (ShapeParameter("a", -3.0, 3.0), ShapeParameter("b", -3.0, 3.0))

    def combinations(self, path):
        counts = np.maximum(path.states, 1).astype(float)
        return [path.network.combinations_of(path.states) * (counts ** [self.a, self.b]).prod(axis=1)[:, None]]


def test_mass_action_is_the_closed_form_to_the_last_bit():
    runs = line_runs()
    closed, fit = estimate(runs), fit_rates(MassActionRates(), runs)
    np.testing.assert_allclose(fit.best.coefficients[0], [e.rate for e in closed.estimates], rtol=1e-15)
    total = closed.total
    one = fit_rates(MassActionRates(), runs[:1])
    np.testing.assert_array_equal([e.exposure[0] for e in one.likelihood.evidence(one.model)], count(runs[0]).exposure)
    assert [row["events"] for row in fit.table()] == total.events.tolist()


def test_several_terms_find_their_closed_forms():
    """Each half of the states has its own events over exposure: the search of two coefficients must find both."""
    runs = line_runs()
    fit = fit_rates(Halves(), runs)
    monomers = [run.states[:, 0] > 5 for run in runs]
    network = runs[0].network
    for many in (True, False):
        events, exposure = np.zeros(8), np.zeros(8)
        for run, is_many in zip(runs, monomers, strict=True):
            waits = np.diff([0.0, *run.times, run.end]) * (is_many == many)
            exposure += network.ways * (waits @ network.combinations_of(run.states)) * run.open_channels
            fired = run.channels[(is_many == many)[:-1]]
            events += np.bincount(fired[fired >= 0], minlength=8)
        found = fit.best.coefficients[0 if many else 1]
        assert (events > 0).any()
        np.testing.assert_allclose(found[exposure > 0], (events / np.maximum(exposure, 1e-9))[exposure > 0], rtol=1e-10)
        assert np.isnan(found[exposure == 0]).all()


def test_profile_limits_without_events_are_known():
    """exp(-k E): twice the loss is 3.841 at k = 1.9207 / E."""
    fit = fit_rates(MassActionRates(), [standing(pair_network(), [2, 3], 2.0)])
    assert fit.interval("k break") == (0.0, pytest.approx(1.920729 / 6.0, rel=1e-6))
    assert fit.log_likelihood == 0.0


def test_two_shapes_are_found_together():
    """A 1e-6 false alarm: the likelihood-ratio statistic of the truth, chi-square with 4 degrees of freedom."""
    rng = np.random.default_rng(3)
    true = TwoPowers(0.5, -1.0)
    _, coefficients = known_parameters(true, pair_network(), STATES[0])
    runs = [drawn_path(true, coefficients, pair_network(), s, 20.0, rng) for s in ([8, 2], [3, 9], [20, 3], [4, 30])]
    fit = fit_rates(TwoPowers(), runs)
    held = fit_rates(TwoPowers(), runs, fixed={"a": 0.5, "b": -1.0})
    assert fit.test_against(held).p_value > 1e-6
    assert fit.test_against(fit_rates(MassActionRates(), runs)).p_value < 1e-6
    low, high = fit.interval("b")
    assert low < fit.parameters["b"] < high < 0


def test_ratio_test_has_its_size_and_sees_waits_that_are_not_exponential():
    """100 mass-action data sets: p-values uniform (false alarm 1e-6). kappa = 1.4: the median p is below 1e-3."""
    rng = np.random.default_rng(5)
    _, k = known_parameters(MassActionRates(), pair_network(), STATES[0])
    p_values = {1.0: [], 1.4: []}
    for kappa, n in ((1.0, 100), (1.4, 20)):
        for _ in range(n):
            runs = pair_runs(Weibull(kappa), k, rng)
            test = fit_rates(Weibull(), runs).test_against(fit_rates(MassActionRates(), runs))
            assert test.freedom == 1
            p_values[kappa].append(test.p_value)
    assert kstest(p_values[1.0], "uniform").pvalue > 1e-6
    assert np.median(p_values[1.4]) < 1e-3


def test_the_right_model_has_the_least_aic_and_the_best_held_out_score():
    rng = np.random.default_rng(6)
    true, coefficients = known_parameters(Crowded(), pair_network(), STATES[0])
    runs = [drawn_path(true, coefficients, pair_network(), s, 40.0, rng) for s in ([8, 2], [2, 9], [10, 40])]
    held_out = [drawn_path(true, coefficients, pair_network(), [20, 30], 5.0, rng) for _ in range(4)]
    fits = [fit_rates(model, runs) for model in (MassActionRates(), Weibull(), Crowded())]
    rows = compare_fits(fits)
    assert [row["aic_above_least"] == 0 for row in rows] == [False, False, True]
    assert np.argmax([fit.score(held_out) for fit in fits]) == 2
    with pytest.raises(ValueError, match="no fits"):
        compare_fits([])
    with pytest.raises(ValueError, match="other paths"):
        fits[2].test_against(fit_rates(MassActionRates(), runs[:1]))


def test_waits_are_rescaled_by_any_model():
    """Weibull waits on the clock of their own model are exponential, on that of mass action they are not."""
    rng = np.random.default_rng(7)
    _, k = known_parameters(MassActionRates(), pair_network(), STATES[0])
    runs = pair_runs(Weibull(2.0), k, rng, n=20, end=20.0)
    fit = fit_rates(Weibull(), runs)
    judged = DiagnosedRuns(tuple(runs), fit)
    constants = [DiagnosedRuns(tuple(runs), each) for each in (None, fit_rates(MassActionRates(), runs))]
    partly = DiagnosedRuns(tuple(runs), fit_rates(Weibull(), runs, ["join"]))  # the break by mass action
    for channel in (0, None):
        assert waiting_times(judged, channel).shape_test(rng)[1] > 1e-3  # a fixed seed
        assert waiting_times(constants[0], channel).shape_test(rng)[1] < 1e-3
        residuals = [waiting_times(each, channel).residuals for each in constants]
        np.testing.assert_allclose(*residuals, rtol=1e-12)
    assert waiting_times(partly, 0).shape_test(rng)[1] > 1e-3
    residuals = [waiting_times(each, 1).residuals for each in (partly, constants[0])]
    np.testing.assert_allclose(*residuals, rtol=1e-12)


def test_one_crowd_alone_leaves_both_terms_open():
    """With one number of bodies only k + c * others is known: either alone may explain all."""
    _, k = known_parameters(MassActionRates(), pair_network(), STATES[0])
    runs = [drawn_path(MassActionRates(), k, pair_network(), STATES[0], 20.0, np.random.default_rng(8))]
    fit = fit_rates(Crowded(), runs)
    assert fit.interval("k break")[0] == fit.interval("c break")[0] == 0.0
    together = fit.parameters["k break"] + 9 * fit.parameters["c break"]
    assert together == pytest.approx(estimate(runs)["break"].rate, rel=1e-9)


@dataclass(frozen=True)
class OnlyOthers(Crowded):
    """A body alone in its tank never breaks."""

    name = "only-others"
    terms = ("c",)

    def combinations(self, path):
        return super().combinations(path)[1:]


def test_an_impossible_event_refutes_a_model():
    path = JumpPath(pair_network(), [0, 1], [1.0], [1], 2.0)
    with pytest.raises(ValueError, match="an event happened that only-others calls impossible"):
        fit_rates(OnlyOthers(), [path])
    possible = fit_rates(OnlyOthers(), [JumpPath(pair_network(), [0, 3], [1.0], [1], 2.0)])
    assert possible.score([path]) == -np.inf


def test_an_event_at_age_zero_has_no_weibull_hazard():
    with pytest.raises(ValueError, match="an event at age 0"):
        fit_rates(Weibull(), [JumpPath(pair_network(), [4, 0], [0.0, 1.0], [0, 0], 2.0)])
