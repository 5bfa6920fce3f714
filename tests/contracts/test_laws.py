"""What every rate law by name must do: be a rate wherever it is asked, check its numbers, be sampled as it is."""

import ast
import inspect
import re
from doctest import DocTestParser

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import General
from kinetics.kernels import general
from kinetics.network import Network
from kinetics.network.laws import LAWS, Expression
from kinetics.network.laws.program import depth, evaluate, steps_of

LAW = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
TIMES = (0.0, 0.3, 7.0, 33.0, 1e4)
COUNTS = (0, 1, 2, 3, 9, 50, 10**6, 10**12)


def example_of(law):
    """The arguments (name -> value) of the call in the example that ends a law's docstring."""
    shown = "".join(each.source for each in DocTestParser().get_examples(inspect.getdoc(law) or ""))
    calls = [node for node in ast.walk(ast.parse(shown)) if isinstance(node, ast.Call)]
    found = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == law.__name__]
    assert found, f"{law.__name__} shows no call of itself, as in: >>> hill('A', vmax=2.0, K=10.0, n=4.0).text"
    call = found[0]
    positional = [ast.literal_eval(value) for value in call.args]
    named = {keyword.arg: ast.literal_eval(keyword.value) for keyword in call.keywords}
    return inspect.signature(law).bind(*positional, **named).arguments


def made(law):
    return law(**example_of(law))


def renamed(arguments, names):
    """The arguments with species of other names."""

    def other(value):
        if isinstance(value, str):
            return names.get(value, value)
        return {other(key): count for key, count in value.items()} if isinstance(value, dict) else value

    return {key: other(value) for key, value in arguments.items()}


def places_of(expression):
    return {name: s for s, name in enumerate(expression.species)}


def states_of(expression):
    """All combinations of counts of the species that it reads, (n, S)."""
    n = len(expression.species)
    return np.stack(np.meshgrid(*[COUNTS] * n, indexing="ij"), axis=-1).reshape(-1, n) if n else np.zeros((1, 0), int)


def values(expression, states, time):
    return evaluate(steps_of(expression, places_of(expression)), states, time)


def kernel_of(expression):
    """The law as the sampling kernel has it, with room for its numbers."""
    steps = steps_of(expression, places_of(expression))
    codes, operands, numbers = zip(*steps, strict=True)
    table = general.Programs(
        np.array(codes, dtype=np.int32),
        np.array(operands, dtype=np.int32),
        np.array(numbers, dtype=float),
        np.array([0, len(steps)]),
    )
    return table, np.empty((2, depth(steps) + 1))


def assert_is_a_rate(expression):
    for time in TIMES:
        found = values(expression, states_of(expression), time)
        assert np.all((found >= 0) & (found < np.inf)), f"{expression} is no rate at t = {time}: {found.min()}"


def assert_bounded(expression):
    """Bounds over windows of time by interval arithmetic hold what the law is within."""
    table, stack = kernel_of(expression)
    low, high, one = np.empty(1), np.empty(1), np.empty(1)
    which = np.array([0])
    for state in states_of(expression):
        counts = np.array([*state, 1])
        for since, until in ((0.0, 0.01), (3.0, 20.0), (99.0, 100.0)):
            general.ranges(table, which, 0, 1, counts, since, until, stack, low, high)
            assert high[0] < np.inf, f"{expression} has no bound at {state} from {since} to {until}"
            for time in np.linspace(since, until, 9):
                general.values(table, which, 0, 1, counts, time, stack, one)
                assert low[0] <= one[0] <= high[0]
                assert_allclose(one[0], values(expression, state, time), rtol=1e-14, atol=1e-300)


def assert_checks_its_numbers(law, arguments):
    """Each number in turn is made nan, infinite or negative: refused, or it still is a rate."""
    for name, given in arguments.items():
        is_list = isinstance(given, list | tuple)
        for place in range(len(given) if is_list else 1):
            for bad in (float("nan"), float("inf"), -3.0):
                if isinstance(given, str | dict):
                    continue
                changed = [*given[:place], bad, *given[place + 1 :]] if is_list else bad
                try:
                    expression = law(**(arguments | {name: changed}))
                except ValueError as error:
                    refusal = str(error)
                else:
                    refusal = ""
                    assert bad == -3.0, f"{law.__name__} takes {name} = {changed}"
                    assert_is_a_rate(expression)
                assert not refusal or (name in refusal and re.search("expected|must", refusal)), refusal


@LAW
def test_it_shows_its_formula_and_an_example(law):
    assert isinstance(made(law), Expression)
    assert "parameters" not in inspect.signature(law).parameters
    assert len((inspect.getdoc(law) or "").splitlines()[0]) > 20


@LAW
def test_it_is_a_rate_at_all_counts_and_times(law):
    assert_is_a_rate(made(law))


@LAW
def test_its_bounds_hold_its_values_over_time(law):
    assert_bounded(made(law))


@LAW
def test_it_checks_its_numbers(law):
    assert_checks_its_numbers(law, example_of(law))


@LAW
def test_species_may_have_any_names(law):
    plain = made(law)
    names = {name: f"{name}-1 (t)" for name in plain.species}
    odd = law(**renamed(example_of(law), names))
    assert odd.species == tuple(names.values())
    assert_array_equal(values(odd, states_of(odd), 5.0), values(plain, states_of(plain), 5.0))


@LAW
def test_in_a_network_it_is_the_propensity_and_waits_for_its_reactants(law):
    expression = made(law)
    needed = dict.fromkeys((*expression.species, "fuel"), 1)
    net = Network.from_reactions({"go": (needed, {"P": 1})}, [expression]).with_rates([1.5], ways=[2.0])
    here = np.array([*[5] * len(expression.species), 1, 0])
    expected = 3.0 * values(expression, np.array([5] * len(expression.species)), 2.0)
    assert_allclose(net.propensities(here, time=2.0), [expected], rtol=1e-14)
    for s in range(len(needed)):
        assert net.propensities(here - (np.arange(here.size) == s) * here, time=2.0) == 0
    if not expression.reads_time:
        assert_array_equal(net.propensities(here), net.propensities(here, time=9.0))


@LAW
def test_sampled_counts_are_those_of_its_rate(law):
    """Made at this rate and not removed, a product is Poisson: mean and variance are the integral of the rate."""
    expression = made(law)
    kept = np.array([4] * len(expression.species))
    grid = np.linspace(0.0, 40.0, 801)  # steps at whole times lie between cells
    middle = (grid[1:] + grid[:-1]) / 2
    rate = np.array([values(expression, kept, time) for time in middle])
    total = rate.sum() * (grid[1] - grid[0])
    assert total > 0, "the example's rate is 0 at four copies"
    k, runs = 50.0 / total, 4000
    net = Network.from_reactions({"make": ({}, {"P": 1})}, [expression], species=[*expression.species, "P"])
    made_ = General().simulate(net.with_rates([k]), [*kept, 0], [40.0], runs=runs, seed=11).counts[:, 0, -1]
    limit = 4.9 * np.sqrt(50.0 / runs)  # a false alarm in 1e6
    assert abs(made_.mean() - 50.0) < limit
    assert abs(made_.mean() - 50.0 * 1.02) > limit  # 2 % more would be seen
    assert abs(made_.var() / made_.mean() - 1) < 4.9 * np.sqrt(2 / runs)


def test_the_checks_see_what_is_wrong_with_a_law():
    def negative(slope):
        return Expression(f"{slope!r} * (5 - A)")

    def unchecked(k):
        return Expression("max(0, k) * A", {"k": 1.0 if np.isnan(k) else min(k, 9.0)})

    with pytest.raises(AssertionError, match="is no rate"):
        assert_is_a_rate(negative(2.0))
    with pytest.raises(AssertionError, match="has no bound"):
        assert_bounded(Expression("A / (t - 10)"))
    with pytest.raises(AssertionError, match="takes k = nan"):
        assert_checks_its_numbers(unchecked, {"k": 2.0})
    with pytest.raises(AssertionError, match="is no rate"):
        assert_checks_its_numbers(lambda k: Expression("k * A", {"k": k}), {"k": 2.0})
    with pytest.raises(AssertionError, match="shows no call"):
        example_of(negative)
