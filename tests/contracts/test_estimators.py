"""What every model of rates must do, so that a new one is tested by its line in `RATE_MODELS`."""

from collections import defaultdict
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.optimize import minimize
from scipy.stats import chi2
from synthetic_models import drawn_path, known_parameters, pair_network, slow_log_likelihood, standing

from calibration import RATE_MODELS, fit_rates
from kinetics.runs import RESTART, JumpPath

NETWORK = pair_network()
STATES = ([8, 2], [3, 9])  # differ in their numbers of bodies, so that a dependence on them can be seen
REPEATS = 60


def runs_of(model, rng, n=4, end=8.0):
    """The true model, its coefficients, and runs restarted after each event, from two compositions."""
    true, coefficients = known_parameters(model, NETWORK, STATES[0])
    runs = [drawn_path(true, coefficients, NETWORK, STATES[i % 2], end, rng) for i in range(n)]
    return true, coefficients, runs


def named(model, coefficients, shape):
    """Parameters by the names that a fit gives them."""
    names = [f"{term} {channel}" for channel in NETWORK.channels for term in model.terms]
    return dict(zip(names, np.transpose(coefficients).ravel(), strict=True)) | {
        parameter.name: getattr(shape, parameter.name) for parameter in model.shape
    }


@pytest.fixture(scope="module", params=RATE_MODELS, ids=lambda model: model.name)
def model(request):
    return request.param


@pytest.fixture(scope="module")
def fitted(model):
    runs = runs_of(model, np.random.default_rng(1))[2]
    return fit_rates(model, runs), runs


def at(fit, parameters):
    """The model and its coefficients (P, R) at parameters by name."""
    model = replace(fit.model, **{p.name: parameters[p.name] for p in fit.model.shape})
    return model, np.array([[parameters[f"{term} {channel}"] for channel in fit.channels] for term in model.terms])


def slow(fit, parameters):
    """The log-likelihood by its definition."""
    return slow_log_likelihood(*at(fit, parameters), fit.likelihood.paths)


def quick(fit, parameters):
    """The same by the code under test, held against its definition in a test of its own."""
    model, coefficients = at(fit, parameters)
    return replace(fit.likelihood, model=model).value(coefficients)


def test_is_named_and_says_what_it_claims(model):
    assert [each.name for each in RATE_MODELS].count(model.name) == 1
    assert len(type(model).__doc__) > 80
    assert len(set(model.terms) | {p.name for p in model.shape}) == len(model.terms) + len(model.shape)
    for parameter in model.shape:
        assert parameter.low < getattr(model, parameter.name) < parameter.high


def test_combinations_do_not_depend_on_the_docking_ways(model):
    """The propensity has them as a factor already: a model that divides by them, or counts them again, is wrong."""
    paths = [
        JumpPath(replace(NETWORK, ways=np.array(ways)), [8, 2], [0.3, 0.5], [0, 1], 1.0)
        for ways in ([4.0, 1.0], [1.0, 7.0])
    ]
    found = [np.array(model.combinations(path)) for path in paths]
    assert found[0].shape == (len(model.terms), 3, 2)
    np.testing.assert_array_equal(*found)


def test_parameters_are_named_and_coefficients_not_negative(fitted):
    fit, _ = fitted
    expected = [f"{term} {channel}" for channel in NETWORK.channels for term in fit.model.terms]
    assert list(fit.parameters) == expected + [p.name for p in fit.model.shape]
    assert all(fit.parameters[name] >= 0 for name in expected)
    for p in fit.model.shape:
        assert p.low <= fit.parameters[p.name] <= p.high
    assert fit.free_parameters == len(fit.parameters)
    assert fit.aic == 2 * len(fit.parameters) - 2 * fit.log_likelihood


def test_likelihood_is_its_definition(fitted):
    """At the estimate and elsewhere, to 1e-10 of its size; restarts, competing channels and the last wait included."""
    fit, _ = fitted
    assert slow(fit, fit.parameters) == pytest.approx(fit.log_likelihood, rel=1e-10)
    true, coefficients, _ = runs_of(fit.model, np.random.default_rng(0), n=1)
    full = [drawn_path(true, coefficients, NETWORK, [30, 0], 3.0, np.random.default_rng(3), restarts=False)]
    again = fit_rates(fit.model, full)
    assert full[0].channels.size > 20
    assert slow(again, again.parameters) == pytest.approx(again.log_likelihood, rel=1e-10)


def test_likelihood_is_largest_at_the_estimate(fitted):
    fit, _ = fitted
    rng = np.random.default_rng(4)
    for size in (1e-3, 0.03, 0.3):
        for _ in range(5):
            other = {
                name: abs(value * (1 + size * rng.normal())) + 1e-3 * size * rng.random()
                for name, value in fit.parameters.items()
            }
            other |= {p.name: float(np.clip(other[p.name], p.low, p.high)) for p in fit.model.shape}
            assert quick(fit, other) <= fit.log_likelihood + 1e-9


def test_interval_is_that_of_the_profile_likelihood(fitted):
    """At its ends a general optimiser of all other parameters has lost what chi-square says."""
    fit, _ = fitted
    loss = chi2.ppf(0.9, 1) / 2
    names = [f"{fit.model.terms[-1]} join", *(p.name for p in fit.model.shape)]
    for name in names:
        low, high = fit.interval(name, 0.9)
        assert low <= fit.parameters[name] <= high
        for end in (low, high):
            others = [key for key in fit.parameters if key != name]
            start = np.sqrt([max(fit.parameters[key], 0.01) for key in others])

            def cost(roots, end=end, name=name, others=others):
                return -quick(fit, {name: end} | dict(zip(others, np.square(roots), strict=True)))

            lost = fit.log_likelihood + minimize(cost, start, method="BFGS", options={"maxiter": 40}).fun
            if end > 0:
                assert lost == pytest.approx(loss, abs=2e-3)
            else:  # the limit is the edge itself
                assert lost <= loss + 2e-3
    wide = fit.interval(names[0], 0.99)
    narrow = fit.interval(names[0], 0.5)
    assert wide[0] <= narrow[0] <= narrow[1] < wide[1]


def test_pooling_is_indifferent_to_order_and_to_cuts_at_restarts(fitted):
    fit, runs = fitted
    pieces = []
    for run in runs:
        edges = [0.0, *run.times[run.channels == RESTART], run.end]
        for begin, end in pairwise(edges):
            inside = (run.times > begin) & (run.times <= end) & (run.channels != RESTART)
            times, channels = run.times[inside] - begin, run.channels[inside]
            pieces.append(JumpPath(NETWORK, run.initial, np.minimum(times, end - begin), channels, end - begin))
    for same in (runs[::-1], pieces):
        again = fit_rates(fit.model, same)
        assert again.log_likelihood == pytest.approx(fit.log_likelihood, rel=1e-9)
        assert list(again.parameters.values()) == pytest.approx(list(fit.parameters.values()), rel=1e-4, abs=1e-9)


def test_another_unit_of_time_changes_no_shape(fitted):
    """In units 10 times smaller each density of an event is 10 times smaller, and what is expected stays."""
    fit, runs = fitted
    slower = [JumpPath(NETWORK, r.initial, r.times * 10, r.channels, r.end * 10) for r in runs]
    again = fit_rates(fit.model, slower)
    n = sum(int((run.channels != RESTART).sum()) for run in runs)
    assert again.log_likelihood == pytest.approx(fit.log_likelihood - n * np.log(10), rel=1e-9)
    for p in fit.model.shape:
        assert again.parameters[p.name] == pytest.approx(fit.parameters[p.name], rel=1e-4)
    np.testing.assert_allclose(again.integrated_hazards(slower[0]), fit.integrated_hazards(runs[0]), rtol=1e-3)


def test_as_many_events_are_expected_as_were_seen(fitted):
    """At the maximum, whatever the model: its coefficients could all be scaled."""
    fit, runs = fitted
    expected = sum(fit.integrated_hazards(run).sum(axis=0) for run in runs)
    seen = [sum(int((run.channels == c).sum()) for run in runs) for c in range(2)]
    np.testing.assert_allclose(expected, seen, rtol=1e-9)


def test_a_channel_without_events_has_an_upper_limit_and_one_without_exposure_none(model):
    only_joins = np.array([True, False])
    true, coefficients = known_parameters(model, NETWORK, STATES[0])
    rng = np.random.default_rng(6)
    runs = [drawn_path(true, coefficients, NETWORK, s, 4.0, rng, open_channels=only_joins) for s in STATES]
    fit = fit_rates(model, runs)
    name = f"{model.terms[0]} break"
    assert np.isnan(fit.parameters[name])
    assert fit.interval(name) == (0.0, np.inf)
    assert fit.free_parameters == len(model.terms) + len(model.shape)
    watched = fit_rates(model, [*runs, standing(NETWORK, [0, 3], 0.5)])
    assert watched.parameters[name] == 0.0
    low, high = watched.interval(name)
    assert low == 0.0
    assert 0 < high < np.inf
    rows = {row["parameter"]: row for row in fit.table()}
    assert rows[name]["note"] == "not measured"


def test_censored_waits_count_in_full(fitted):
    """Hours without an event lower what is expected an hour, and the likelihood falls by what they were expected to
    show."""
    fit, runs = fitted
    idle = standing(NETWORK, STATES[0], 0.7)
    missed = fit.integrated_hazards(idle).sum()
    assert missed > 0.1
    assert fit.score([idle]) == pytest.approx(-missed, rel=1e-12)
    longer = fit_rates(fit.model, [*runs, idle])
    assert longer.log_likelihood >= fit.log_likelihood - missed
    hazards = [each.integrated_hazards(idle).sum() for each in (fit, longer)]
    assert hazards[1] < hazards[0]


def test_held_out_score_is_the_likelihood_of_other_paths(fitted):
    fit, runs = fitted
    assert fit.score(runs) == pytest.approx(fit.log_likelihood, rel=1e-12)
    others = runs_of(fit.model, np.random.default_rng(8), n=2)[2]
    coefficients = fit.best.coefficients
    assert fit.score(others) == pytest.approx(slow_log_likelihood(fit.model, coefficients, others), rel=1e-10)


def test_channels_may_be_fitted_alone_and_shapes_held(fitted):
    fit, runs = fitted
    shape = {p.name: fit.parameters[p.name] for p in fit.model.shape}
    held = fit_rates(fit.model, runs, fixed=shape)
    assert held.log_likelihood == pytest.approx(fit.log_likelihood, rel=1e-12)
    assert held.free_parameters == fit.free_parameters - len(shape)
    parts = [fit_rates(fit.model, runs, channels=[name], fixed=shape) for name in NETWORK.channels]
    assert sum(part.log_likelihood for part in parts) == pytest.approx(fit.log_likelihood, rel=1e-12)
    assert parts[1].channels == ("break",)


def test_table_and_plot_come_with_the_base(fitted):
    fit, _ = fitted
    rows = fit.table(0.9)
    assert [row["parameter"] for row in rows] == list(fit.parameters)
    assert all(row["low"] <= row["estimate"] <= row["high"] for row in rows)
    ax = fit.plot(Figure().add_subplot())
    ax.figure.draw_without_rendering()
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert labels == list(fit.parameters)[: len(labels)]
    assert ax.get_title().startswith(fit.model.name)


def test_intervals_hold_the_truth_and_not_a_wrong_one(model):
    """60 data sets with known parameters: each true value is inside its 90 % interval in 54 of them on average.

    Inside is where the profile has lost less than the quantile. Fewer than 44 of 60 have the chance 1e-4 a parameter.
    Control: with all coefficients twice as large, the 90 % region of all parameters together holds them less than 10
    times.
    """
    rng = np.random.default_rng(9)
    loss = chi2.ppf(0.9, 1) / 2
    inside, wrong = defaultdict(int), 0
    for _ in range(REPEATS):
        true, coefficients, runs = runs_of(model, rng)
        fit, known = fit_rates(model, runs), named(model, coefficients, true)
        shape = {p.name for p in model.shape}
        for name in [f"{model.terms[-1]} join", *shape]:
            inside[name] += fit.log_likelihood - fit.profile(name, known[name]) <= loss
        off = {name: value if name in shape else 2 * value for name, value in known.items()}
        wrong += fit.log_likelihood - quick(fit, off) <= chi2.ppf(0.9, len(known)) / 2
    assert min(inside.values()) >= 44, dict(inside)
    assert wrong < 10


def test_refuses_what_cannot_be_fitted(fitted):
    fit, runs = fitted
    model = fit.model
    other = pair_network()
    other = replace(other, ways=np.array([2.0, 1.0]))
    cases = [
        (lambda: fit_rates(model, []), "no runs to fit"),
        (lambda: fit_rates(model, runs, channels=["5->6"]), r"unknown channel '5->6'; channels are join, break"),
        (lambda: fit_rates(model, runs, channels=[]), "expected one or more"),
        (lambda: fit_rates(model, runs, channels=["join", "join"]), "each once"),
        (lambda: fit_rates(model, runs, fixed={"delta": 1.0}), "unknown shape parameter 'delta'"),
        (lambda: fit_rates(model, [runs[0], standing(other, [2, 0])]), "two conventions"),
        (lambda: fit.interval("k nothing"), "unknown parameter 'k nothing'"),
        (lambda: fit.interval(next(iter(fit.parameters)), 1.5), "level = 1.5"),
        (lambda: fit.test_against(fit), "expected the smaller model"),
    ]
    cases += [
        (lambda p=parameter: fit_rates(model, runs, fixed={p.name: p.high + 1}), f"{parameter.name} = ")
        for parameter in model.shape
    ]
    for call, message in cases:
        with pytest.raises(ValueError, match=message):
            call()
