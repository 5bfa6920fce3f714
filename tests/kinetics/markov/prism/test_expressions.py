"""Values, types and precedence of expressions, against numbers written by hand from the manual."""

import math

import numpy as np
import pytest
from mpmath import mp, mpf

from kinetics.markov.prism.expressions import ExpressionReader
from kinetics.markov.prism.terms import Scope
from kinetics.markov.prism.tokens import TokenReader, tokens_of
from kinetics.markov.prism.values import States, bounds_of, values_of

TABLE = np.array([[2, 0], [5, 1], [0, 0]])  # x, up


def term(text, formulas=()):
    named = {}
    for name, value in formulas:
        named[name] = (tokens_of(name)[0], ExpressionReader(TokenReader(value)).expression())
    scope = Scope({"x": (0, "int"), "up": (1, "bool")}, lambda token, depth: None, named)
    return scope.term(ExpressionReader(TokenReader(text)).expression())


def states():
    return States(["x", "up"], ["int", "bool"], TABLE)


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [
        ("1 + 2 * 3 - 4", "int", 3),
        ("2 - 3 - 4", "int", -5),
        ("8 / 4 / 2", "double", 1),
        ("8 / (4 / 2)", "double", 4),
        ("7 / 2", "double", 3.5),
        ("-2 * -3", "int", 6),
        ("--2", "int", 2),
        ("1e3 + .5", "double", 1000.5),
        ("floor(-0.5) + ceil(1.1) + round(2.5)", "int", -1 + 2 + 3),
        ("min(3, 1, 2) + max(1, 2.5)", "double", 3.5),
        ("pow(2, 10) + mod(7, 3)", "int", 1025),
        ("pow(4, 0.5)", "double", 2),
        ("mod(-1, 3)", "int", 2),
        ("log(8, 2)", "double", 3),
        ("func(min, 4, 3)", "int", 3),
        ("true & !false", "bool", True),
        ("!1 = 2", "bool", True),  # of the comparison
        ("!true | true", "bool", True),
        ("false & false | true", "bool", True),
        ("true | true & false", "bool", True),
        ("true => false", "bool", False),
        ("false => false & false", "bool", True),
        ("true <=> false => false", "bool", True),  # <=> is tighter
        ("(true => true) <=> true", "bool", True),
        ("1 < 2 = true", "bool", True),
        ("1 != 2 & 2.0 = 2", "bool", True),
        ("true ? 1 : false ? 2 : 3", "int", 1),
        ("false ? 1 : false ? 2 : 3.0", "double", 3),
    ],
)
def test_values_without_variables(text, kind, expected):
    read = term(text)
    assert read.kind == kind
    assert values_of(read, states()) == pytest.approx(expected, abs=1e-15)
    assert read.is_known


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x * x - x", [2, 20, 0]),
        ("x > 1 & up", [False, True, False]),
        ("up ? x : -x", [-2, 5, 0]),
        ("x != 0 & 1 / x < 0.3", [False, True, False]),  # no division where x is 0
        ("x = 0 | 1 / x < 0.3", [False, True, True]),
        ("x > 0 => mod(7, x) = 1", [True, False, True]),
        ("x = 0 ? 0 : 6 / x", [3, 1.2, 0]),
        ("up <=> x = 5", [True, True, True]),
        ("up = true", [False, True, False]),
        ("f + 1", [4, 7, 2]),
        ("g", [True, False, True]),
    ],
)
def test_values_in_states(text, expected):
    read = term(text, [("f", "x + h"), ("h", "2 - 1"), ("g", "!up")])
    assert np.broadcast_to(values_of(read, states()), 3).tolist() == pytest.approx(expected)


@pytest.mark.parametrize(
    ("text", "real"),
    [
        ("1 / 3", lambda x, up: mpf(1) / 3),
        ("x / 7 + 0.1", lambda x, up: x / 7 + mpf(0.1)),
        ("min(0.1 * 3, x)", lambda x, up: min(mpf(0.1) * 3, x)),
        ("up ? 0.1 * x : pow(1.1, x)", lambda x, up: mpf(0.1) * x if up else mpf(1.1) ** x),
        ("log(3, 7)", lambda x, up: mp.log(3) / mp.log(7)),
        ("-0.1 * x / 3", lambda x, up: -mpf(0.1) * x / 3),
    ],
)
def test_bounds_hold_the_real_value(text, real):
    """Rational arithmetic of the doubles in the text, and logarithms to 50 digits."""
    low, high = (np.broadcast_to(end, 3) for end in bounds_of(term(text), states()))
    with mp.workdps(50):
        for k, (x, up) in enumerate(TABLE.tolist()):
            exact = real(mpf(x), up)
            assert low[k] <= exact <= high[k]
            assert high[k] - low[k] <= 1e-14 * abs(exact)
            assert not low[k] <= exact + (abs(exact) * mpf("1e-12") or mpf("1e-300")) <= high[k]


def test_bounds_of_numbers_that_are_known_are_the_numbers():
    for text in ("x * 3", "x / 2", "0.5 * x + 0.25", "floor(x / 3)"):
        low, high = bounds_of(term(text), states())
        assert (low == high).all()


def test_a_long_sum_is_no_deep_one():
    """5,000 parts, which would be too many calls in each other; one sign in the middle counts."""
    text = " + ".join(["x"] * 2_500) + " - " + " + ".join(["1"] * 2_500)
    assert values_of(term(text), states()).tolist() == [2 * 2500 + 2498, 5 * 2500 + 2498, 2498]


def test_powers_of_whole_numbers_are_whole():
    assert values_of(term("pow(3, 33)"), states()) == 3**33
    assert math.isclose(values_of(term("pow(3.0, 33)"), states()), 3.0**33)
