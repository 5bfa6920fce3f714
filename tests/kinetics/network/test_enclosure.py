"""Rate laws enclosed: against 50 digits, with what the library is trusted with, and with what is known exactly."""

import ast
import math

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from kinetics.markov.transient import StateSpace
from kinetics.network import Network
from kinetics.network.laws import Expression, enclosure, hill, hill_repression, michaelis_menten
from kinetics.network.laws.graph import Code
from kinetics.network.laws.of_channels import ROUNDING
from kinetics.network.laws.program import evaluate, steps_of

PLACES = {"A": 0, "B": 1}
FUNCTIONS = {name: getattr(mpmath, name) for name in ("log", "sqrt", "floor", "ceil")}
LARGEST = 1e4  # of exponents and angles; beyond, digits by the million would be needed


def limited(function):
    def found(x):
        if abs(x) > LARGEST:
            raise OverflowError
        return function(x)

    return found


def power(x, y):
    if abs(y) > 100 or (not 1e-30 < abs(x) < 1e30 and x):
        raise OverflowError
    return x**y


FUNCTIONS |= {name: limited(getattr(mpmath, name)) for name in ("exp", "sin", "cos")}


def piecewise(*arguments):
    for value, condition in zip(arguments[:-1:2], arguments[1::2], strict=True):
        if condition:
            return value
    return arguments[-1]


class Real(ast.NodeTransformer):
    """Literals as the doubles that they are read as, and powers as calls."""

    def visit_BinOp(self, node):
        self.generic_visit(node)
        if isinstance(node.op, ast.Pow):
            return ast.Call(ast.Name("power", ast.Load()), [node.left, node.right], [])
        return node

    def visit_Constant(self, node):
        number = ast.Call(ast.Name("mpf", ast.Load()), [ast.Constant(float(node.value))], [])
        return ast.copy_location(number, node)


def real_value(text, counts, **parameters):
    """The value of an expression to 50 digits; nan where it has none."""
    tree = ast.fix_missing_locations(Real().visit(ast.parse(text, mode="eval")))
    names = dict(zip(PLACES, map(mpmath.mpf, counts), strict=True))
    names |= {name: mpmath.mpf(value) for name, value in parameters.items()} | {"pi": mpmath.mpf(math.pi)}
    others = {
        "mpf": mpmath.mpf,
        "piecewise": piecewise,
        "min": min,
        "max": max,
        "abs": abs,
        "pow": power,
        "power": power,
    }
    with mpmath.workdps(50):
        try:
            found = mpmath.mpmathify(eval(compile(tree, "law", "eval"), names | FUNCTIONS | others))
        except (ZeroDivisionError, ValueError, OverflowError, TypeError, mpmath.libmp.ComplexResult):
            return math.nan  # a complex number is not compared either
        return found if isinstance(found, mpmath.mpf) and mpmath.isfinite(found) else math.nan


def ends(text, counts, **parameters):
    steps = steps_of(Expression(text, parameters), PLACES, folds=False)
    low, high = enclosure.enclosed(steps, np.array([counts]))
    return float(low[0]), float(high[0])


def check(text, counts, **parameters):
    """The real value, and what the machine finds, lie within."""
    low, high = ends(text, counts, **parameters)
    exact = real_value(text, counts, **parameters)
    assert not (mpmath.isfinite(exact) and (low > exact or high < exact)), f"{text} is {exact}, not {low} to {high}"
    here = float(evaluate(steps_of(Expression(text, parameters), PLACES), np.array(counts), 0.0))
    if np.isfinite([low, high, here]).all():
        near = 8.0 * math.ulp(max(abs(low), abs(high)))
        assert low - near <= here <= high + near
    return low, high


NUMBERS = st.sampled_from(["0", "1", "2", "3", "0.1", "0.5", "1e-17", "1e17", "2.5", "pi", "1e9", "7.3"])
ONE = ("exp({})", "log({})", "sqrt({})", "sin({})", "cos({})", "abs({})", "-({})", "exp(-{})", "(not {})")
ROUNDED = ("floor({})", "ceil({})")
TWO = ("({} + {})", "({} - {})", "({} * {})", "({} / {})", "({} ** {})", "min({}, {})", "max({}, {})")
JUMPS = ("({} < {})", "({} <= {})", "({} == {})", "({} != {})", "({} > {} or A < 2)", "({} >= {} and B > 1)")
THREE = ("piecewise({}, {} < {}, 2)", "piecewise({}, B > {}, {})")


def texts():
    def larger(inner):
        def made(forms, n):
            return st.builds(lambda form, *parts: form.format(*parts), st.sampled_from(forms), *[inner] * n)

        return st.one_of(
            made(ONE, 1), made(ROUNDED, 1), made(TWO, 2), made(TWO, 2), made((*JUMPS, "({} % {})"), 2), made(THREE, 3)
        )

    return st.recursive(st.one_of(NUMBERS, st.sampled_from(["A", "B"])), larger, max_leaves=10)


@settings(max_examples=250, deadline=None, derandomize=True)
@given(texts(), st.tuples(st.integers(0, 40), st.integers(0, 10**9)))
@example("1e17 * (1 - exp(-1e-17 * A))", (10, 0))
@example("floor(0.1 * A) * (B / 3 * 3 - B)", (30, 7))
def test_random_laws_lie_within(text, counts):
    check(text, counts)


LAWS = (
    ("1e17 * (1 - exp(-1e-17 * A))", {}),
    ("2e9 * (1 - exp(-A / 1e9))", {}),
    ("0.1 * A - 0.3 * B", {}),
    ("vmax * A / (K + A)", {"vmax": 0.3, "K": 17.3}),
    ("A ** n / (K ** n + A ** n)", {"n": 2.7, "K": 9.1}),
    ("exp(-A / 7.1) * sin(A / 3) ** 2", {}),
    ("A * (1 / 3 + 1 / 7 - 0.47)", {}),
    ("sqrt(A) * sqrt(A) - A + log(A + 1)", {}),
)


@pytest.mark.parametrize(("text", "parameters"), LAWS)
def test_laws_lie_within(text, parameters):
    for a in range(60):
        check(text, (a, 3), **parameters)


@pytest.mark.parametrize(("text", "parameters"), LAWS)
def test_without_rounding_outwards_they_do_not(text, parameters, monkeypatch):
    """The control: every one of these laws leaves such intervals somewhere."""
    monkeypatch.setattr(enclosure, "_rounded", lambda low, high, *_: enclosure.Interval(low, high))
    monkeypatch.setattr(enclosure, "_outwards", lambda values, _: enclosure.Interval(values, values))
    with pytest.raises(AssertionError, match="not "):
        test_laws_lie_within(text, parameters)


@pytest.mark.parametrize(
    ("code", "low", "high"),
    [(Code.EXP, -700, 700), (Code.LOG, 0, 300), (Code.SINE, -1e7, 1e7), (Code.COSINE, -1e7, 1e7), (Code.SINE, -9, 9)],
)
def test_the_library_is_as_accurate_as_it_is_trusted_to_be(code, low, high):
    rng = np.random.default_rng(int(code))
    x = rng.uniform(low, high, 4000)
    x = np.append(10.0 ** (2 * x - 300) if code == Code.LOG else x, rng.normal(1.0, 1e-3, 500))
    with mpmath.workdps(50):
        exact = [getattr(mpmath, {"SINE": "sin", "COSINE": "cos"}.get(code.name, code.name.lower()))(v) for v in x]
        found = enclosure.UFUNCS[code](x)
        ulps = [float(abs(mpmath.mpf(one) - other) / math.ulp(one)) for one, other in zip(found, exact, strict=True)]
    assert max(ulps) <= enclosure.LIBRARY_ULPS
    assert max(ulps) > 0.4  # the control: it does round


def test_powers_are_as_accurate_as_they_are_trusted_to_be():
    rng = np.random.default_rng(1)
    x = np.append(rng.uniform(0, 100, 2000), rng.integers(0, 10**6, 2000))
    y = np.append(rng.uniform(-40, 40, 2000), rng.choice([0.5, 1.5, 2.0, 2.7, 3.0, 4.0, 8.0, -2.0], 2000))
    x[x == 0] = 0.5
    with mpmath.workdps(50):
        exact = [mpmath.mpf(base) ** mpmath.mpf(exponent) for base, exponent in zip(x, y, strict=True)]
        found = np.power(x, y)
        ulps = [float(abs(mpmath.mpf(one) - other) / math.ulp(one)) for one, other in zip(found, exact, strict=True)]
    assert 0.4 < max(ulps) <= enclosure.LIBRARY_ULPS


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("max(0, A - B)", 0.0),
        ("0.5 * A - 0.5 * B", 0.0),
        ("A ** 2 - B * A", 0.0),
        ("A * (A - 7) * exp(-A / 3)", 0.0),
        ("1 - exp(0 * A)", 0.0),
        ("log(A - 6) + sqrt(A + 2) - 3 + sin(B - 7)", 0.0),
        ("A / 2 + B / 4", 5.25),
        ("piecewise(3, A == B, 2)", 3.0),
        ("floor(A / 2) + A % 4", 6.0),
        ("0 ** A + A ** 1 + cos(0)", 8.0),
    ],
)
def test_what_is_exact_stays_so(text, expected):
    assert ends(text, (7, 7)) == (expected, expected)


@pytest.mark.parametrize("text", ["1 / (A - 7)", "log(A - 7)", "sqrt(A - 8)", "(A - 8) ** 0.5", "A % (A - 7)", "t"])
def test_what_may_be_undefined_is_nan(text):
    assert np.isnan(ends(text, (7, 7))).any()


def test_jumps_within_an_interval():
    assert ends("floor(0.1 * A / 0.1)", (3, 0)) in {(2.0, 3.0), (3.0, 3.0)}
    assert ends("floor(A / 3 * 3)", (7, 0)) == (6.0, 7.0)
    assert ends("piecewise(1, A / 3 * 3 < 7, 5)", (7, 0)) == (1.0, 5.0)
    assert ends("piecewise(1, A / 3 * 3 < 8, 5)", (7, 0)) == (1.0, 1.0)


# Relative errors of rates.


def worst(law, a_to=60, constant=1.0, at_zero="block"):
    """The error that is stated and the largest true one, in roundings, for A from 0 and 3 of B."""
    net = Network.from_reactions({"d": ({"A": 1}, {})}, [law], at_zero=at_zero, species=("A", "B"))
    net = net.with_rates([constant])
    states = np.column_stack([np.arange(a_to), np.full(a_to, 3)])
    rates = net.propensities(states)[:, 0]
    true = 0.0
    with mpmath.workdps(50):
        for (a, b), rate in zip(states.tolist(), rates.tolist(), strict=True):
            exact = constant * real_value(net.laws["d"].text, (a, b), **net.laws["d"].parameters) if a else 0.0
            if exact or rate:
                true = max(true, float(abs(rate - exact) / min(rate, exact) / ROUNDING) if exact * rate > 0 else np.inf)
    return float(StateSpace(net, states, np.zeros(a_to, dtype=bool)).rate_errors[0]), true


@pytest.mark.parametrize(
    ("law", "least", "most"),
    [
        (michaelis_menten("A", 0.3, 17.3), 1.9, 7.0),
        (hill("A", 0.3, 9.1, 2.0, 0.7), 0.8, 4.0),
        (hill("A", 0.3, 9.1, 2.7, 0.7), 1.0, 9.0),
        (hill_repression("B", 0.3, 9.1, 2.7, 0.7), 0.1, 2.0),
        ("2e9 * (1 - exp(-A / 1e9))", 2e8, 1e10),
        ("max(0, A - 1)", 0.0, 2.0),
    ],
)
def test_errors_of_rates(law, least, most):
    for constant in (1.0, 0.3):
        stated, true = worst(law, constant=constant)
        assert least <= true <= stated <= most


@pytest.mark.parametrize(
    "law", ["1e17 * (1 - exp(-1e-17 * A))", "max(0, 0.1 * A - 0.3)", "floor(A / 3 * 3)", "exp(-800 * A)"]
)
def test_rates_of_which_nothing_is_known(law):
    assert worst(law)[0] == np.inf


def test_rates_that_are_nowhere_do_not_count():
    """Stopped states, channels that change nothing, and a law whose constant is 0."""
    with pytest.warns(UserWarning, match="changes nothing"):
        net = Network.from_reactions({"d": ({"A": 1}, {}), "same": ({"A": 1}, {"A": 1})}, [2.0, "floor(A / 3 * 3)"])
    states = np.arange(60)[:, None]
    assert StateSpace(net, states, np.zeros(60, dtype=bool)).rate_errors.tolist() == [8.0, 0.0]
    net = Network.from_reactions({"d": ({"A": 1}, {})}, ["floor(A / 3 * 3)"])
    assert StateSpace(net, states, np.ones(60, dtype=bool)).rate_errors.tolist() == [0.0]
    assert StateSpace(net, states, np.zeros(60, dtype=bool)).rate_errors.tolist() == [np.inf]
