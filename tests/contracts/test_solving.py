"""What every solving method must do; a method in `SOLVING_METHODS` is tested by this."""

from dataclasses import fields, replace

import numpy as np
import pytest
from exact_distributions import SYSTEMS, blurred, summed_error, transient_distribution
from known_systems import bare_line, decay, line, network, switch
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm
from scipy.stats import binom

from kinetics import solve
from kinetics.markov.transient import SOLVING_METHODS, SolvingMethod, reachable
from kinetics.support import memory

every_method = pytest.mark.parametrize("method", SOLVING_METHODS, ids=[method.name for method in SOLVING_METHODS])
every_system = pytest.mark.parametrize("system", SYSTEMS, ids=[system.name for system in SYSTEMS])


def test_names_differ():
    assert len({method.name for method in SOLVING_METHODS}) == len(SOLVING_METHODS)


@every_method
def test_settings_are_fields_with_defaults_that_cannot_be_changed(method):
    assert isinstance(method(), SolvingMethod)
    assert method() == method()
    assert (method.least_tolerance is not None) == ("tolerance" in {field.name for field in fields(method)})
    for field in fields(method):
        with pytest.raises(AttributeError):
            setattr(method(), field.name, 1)


@every_method
def test_independent_copies_are_binomial(method):
    times = np.array([0.0, 0.1, 0.7, 5.0])
    found = solve(switch(1.0, 2.0), method(), [40, 0], times)
    in_b = (1.0 - np.exp(-3.0 * times)) / 3.0
    copies = np.arange(41)
    exact = binom(40, in_b[:, None]).pmf(copies)
    probabilities = np.array([found.probability([40 - n, n]) for n in copies]).T
    assert abs(probabilities - exact).sum(axis=1).max() < found.error + 1e-13
    assert_allclose(found.mean()[:, 1], 40 * in_b, rtol=1e-12, atol=40 * found.error)
    assert_allclose(found.sd()[:, 1], np.sqrt(40 * in_b * (1 - in_b)), rtol=1e-10, atol=1e-7 + 40 * found.error)


@every_method
def test_the_line_of_four_is_as_scipy_has_it(method):
    times = [30.0, 400.0]
    found = solve(line(), method(), [16, 0, 0, 0], times)
    space = reachable(line(), [16, 0, 0, 0])
    generator = space.generator().toarray()
    for t, time in enumerate(times):
        exact = expm(generator * time)[0]
        mine = np.array([found.probability(state)[t] for state in space.states])
        assert abs(mine - exact).sum() < found.error + 1e-12  # scipy rounds too


@every_system
@every_method
def test_the_error_covers_the_distance_from_a_hundred_digits(method, system):
    times = [0.0, system.time / 2, system.time]
    refusal = ""
    try:
        found = method().solve(system.net, system.start, times)
    except ValueError as refused:
        refusal = str(refused)
    if refusal:
        assert system.name == "stiff"
        assert "too stiff" in refusal
        return
    exact = [transient_distribution(system, time) for time in times]
    assert max(summed_error(found, t, exact[t]) for t in range(len(times))) <= found.error < 1e-6
    # The control: rates wrong by a hundred times the error.
    wrong = method().solve(blurred(system.net, max(1e-9, 100 * found.error)), system.start, times)
    assert summed_error(wrong, 2, exact[2]) > wrong.error


@every_method
def test_time_zero_is_the_start(method):
    for times in ([0.0], [0.0, 0.5]):
        found = method().solve(switch(), [3, 2], times)
        assert_array_equal(found.mean()[0], [3, 2])
        assert_array_equal(found.probability([3, 2])[0], 1.0)


@every_method
def test_nothing_happens_where_nothing_can(method):
    for quiet, start in ((decay(), [0]), (decay(0.0), [3]), (line(), [1, 0, 0, 0])):
        found = method().solve(quiet, start, [0.0, 1.0, 5.0])
        assert_allclose(found.probabilities, 1.0, rtol=0, atol=1e-15)
        assert_array_equal(found.sd(), 0.0)


@every_method
def test_probabilities_are_positive_and_sum_to_one(method):
    found = method().solve(line(), [14, 0, 0, 0], np.linspace(0.0, 900.0, 7))
    assert found.probabilities.min() >= 0.0
    assert abs(found.probabilities.sum(axis=1) - 1.0).max() <= found.error + 1e-14
    assert type(found.is_bound) is bool
    assert type(found.error) is float
    assert 0.0 < found.error < 1e-6


@every_method
def test_many_times_are_each_as_good_as_one(method):
    times = np.geomspace(1e-3, 40.0, 30)
    together = method().solve(switch(3.0, 5.0), [6, 0], times)
    for i in (0, 13, 29):
        alone = method().solve(switch(3.0, 5.0), [6, 0], times[i : i + 1])
        assert_allclose(together.mean()[i], alone.mean()[0], rtol=0, atol=6 * (together.error + alone.error))


@every_method
def test_a_rate_law_is_solved(method):
    by_law = replace(switch(1.0, 2.0), laws={"forward": "1.0 * A"})
    found, same = (method().solve(net, [5, 0], [0.3, 2.0]) for net in (by_law, switch(1.0, 2.0)))
    assert_allclose(found.mean(), same.mean(), rtol=0, atol=5 * (found.error + same.error))
    assert found.is_bound == same.is_bound
    assert found.error < same.error + 1e-13
    lost = replace(switch(1.0, 2.0), laws={"forward": "1e17 * (1 - exp(-1e-17 * A))"})  # none of its digits are known
    assert not method().solve(lost, [5, 0], [0.3, 2.0]).is_bound
    saturating = replace(switch(1.0, 2.0), laws={"forward": "3.0 * A / (2.0 + A)"})
    slower = method().solve(saturating, [5, 0], [0.3, 2.0])
    assert abs(slower.mean() - found.mean()).max() > 0.1  # the control


@every_method
def test_a_rate_that_depends_on_time_is_refused(method):
    daily = replace(switch(), laws={"forward": "A * (1 + 0.5 * sin(t))"})
    with pytest.raises(ValueError, match="time"):
        method().solve(daily, [5, 0], [1.0])


@every_method
def test_missing_rates_are_refused_before_the_states_are_explored(method):
    with pytest.raises(ValueError, match="no rate constants"):
        method().solve(bare_line(), [10**6, 0, 0, 0], [1.0])


@every_method
@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([], "times is empty"),
        ([2.0, 1.0], "times must rise; 1 comes after 2"),
        ([2.0, 2.0], "times must rise; 2 comes after 2"),
        ([-1.0], "times holds -1"),
        ([np.nan], "times holds nan"),
        ([np.inf], "times holds inf"),
        ([[1.0]], "times has shape"),
    ],
)
def test_times_that_are_none_are_refused(method, times, message):
    with pytest.raises(ValueError, match=message):
        method().solve(switch(), [3, 0], times)


@every_method
@pytest.mark.parametrize(
    ("start", "message"), [([3], "state has shape"), ([-1, 0], "at least 0"), ([0.5, 0], "whole numbers")]
)
def test_a_start_that_is_none_is_refused(method, start, message):
    with pytest.raises(ValueError, match=message):
        method().solve(switch(), start, [1.0])


@every_method
def test_a_space_without_end_is_solved_or_refused_with_advice(method):
    births = network("X", {"birth": ((0,), (1,))}, [1.0])
    with pytest.raises(ValueError, match=r"states .*Ask for|states are reachable.* raise max_states"):
        method(max_states=50).solve(births, [0], [100.0])


@every_method
@pytest.mark.parametrize("states", [0, -1, 2.5, True])
def test_a_largest_number_of_states_that_is_none_is_refused(method, states):
    with pytest.raises(ValueError, match="max_states = "):
        method(max_states=states)


@pytest.mark.parametrize("method", [method for method in SOLVING_METHODS if hasattr(method, "tolerance")])
@pytest.mark.parametrize("tolerance", [0.0, -1.0, 1e-19, 1.0, np.nan])
def test_a_tolerance_that_is_none_is_refused(method, tolerance):
    with pytest.raises(ValueError, match=r"tolerance = .*; expected between"):
        method(tolerance=tolerance)


@pytest.mark.parametrize("method", [method for method in SOLVING_METHODS if hasattr(method, "max_seconds")])
@pytest.mark.parametrize("seconds", [0.0, -1.0, np.nan])
def test_a_longest_time_that_is_none_is_refused(method, seconds):
    with pytest.raises(ValueError, match=r"max_seconds = .*; expected a time above 0"):
        method(max_seconds=seconds)


@pytest.mark.parametrize("method", SOLVING_METHODS)
@pytest.mark.parametrize("setting", ["tolerance", "max_seconds"])
@pytest.mark.parametrize("value", ["x", None, True, [0.5], 1j])
def test_a_setting_that_is_no_number_is_refused(method, setting, value):
    if not hasattr(method, setting):
        pytest.skip(f"{method.__name__} has no {setting}")
    with pytest.raises(ValueError, match=rf"{setting} = .*; expected a number"):
        method(**{setting: value})


@every_method
def test_what_does_not_fit_into_memory_is_refused(method, monkeypatch):
    monkeypatch.setattr(memory, "SMALL", 0)
    monkeypatch.setattr(memory, "available_bytes", lambda: 1e3)
    with pytest.raises(ValueError, match="GB of memory"):
        method().solve(switch(), [100, 0], np.linspace(0.0, 1.0, 100))
