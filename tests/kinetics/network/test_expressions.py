"""Expressions: what is read and refused, their values, their bounds over time, and laws by name."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from kinetics.kernels import intervals, programs
from kinetics.network.laws import (
    LAWS,
    Expression,
    hill,
    hill_repression,
    mass_action,
    michaelis_menten,
    periodic,
    steps_in_count,
    steps_in_time,
)
from kinetics.network.laws.graph import BudgetError, Code, Graph
from kinetics.network.laws.program import depth, evaluate, steps_of
from kinetics.network.laws.reading import node_of

PLACES = {"A": 0, "B": 1}
LAW = "k * A * (1 + 0.5 * sin(2 * pi * t / 24))"


def programs_of(*expressions):
    steps = [steps_of(expression, PLACES) for expression in expressions]
    flat = [step for program in steps for step in program]
    table = programs.Programs(
        np.array([step.code for step in flat], dtype=np.int32),
        np.array([step.operand for step in flat], dtype=np.int32),
        np.array([step.number for step in flat], dtype=float),
        np.cumsum([0, *map(len, steps)]),
    )
    return table, np.empty((2, max(map(depth, steps)) + 1))


def by_machine(expression, counts, time):
    table, stack = programs_of(expression)
    result = np.empty(1)
    programs.values(table, np.array([0]), 0, 1, np.array([*counts, 1]), time, stack, result)
    return result[0]


def bounds(expression, counts, since, until):
    table, stack = programs_of(expression)
    lows, highs = np.empty(1), np.empty(1)
    intervals.ranges(table, np.array([0]), 0, 1, np.array([*counts, 1]), since, until, stack, lows, highs)
    return lows[0], highs[0]


def value(text, counts=(0, 0), time=0.0, **parameters):
    """By both machines, which must agree."""
    expression = Expression(text, parameters)
    here = float(evaluate(steps_of(expression, PLACES), np.array(counts), time))
    assert_allclose(by_machine(expression, counts, time), here, rtol=1e-15, atol=1e-300)
    return here


def test_codes_of_the_kernel_are_those_of_the_programs():
    assert {code.name: code.value for code in Code} == {code.name: getattr(programs, code.name) for code in Code}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("vmax * A / (K + A)", 2.0 * 7 / (3.0 + 7)),
        (LAW.replace("k", "vmax"), 2.0 * 7 * (1 + 0.5 * math.sin(2 * math.pi * 5 / 24))),
        ("piecewise(2.0, A > 10, 0.5)", 0.5),
        ("piecewise(1, A > 10, 2, A > 5, 3)", 2.0),
        ("-A + 2 ** 3 - +B", -1.0),
        ("A - B - 1", 4.0),
        ("8 / 4 / 2", 1.0),
        ("2 ** 3 ** 2", 512.0),
        ("-7 % 3 + A % 4", 5.0),
        ("1 < A <= 7 and not B == 1", 1.0),
        ("A < 3 or B >= 2", 1.0),
        ("A and not (B - 2)", 1.0),
        ("min(A, B, 5) + max(A, B) + abs(B - A)", 14.0),
        ("pow(A, 2) + sqrt(16) + exp(0) + log(1) + cos(0)", 55.0),
        ("floor(-1.5) + ceil(1.2)", 0.0),
        ("3 * (A - 1) * (A - 2)", 90.0),
        ("piecewise(1 / (B - 2), B != 2, 9)", 9.0),
        ("(A > 3) * 4", 4.0),
        ("A\n  +  B", 9.0),
    ],
)
def test_values(text, expected):
    assert value(text, (7, 2), 5.0, vmax=2.0, K=3.0) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no expression"),
        ("k * ", "cannot read 'k \\*'"),
        ("spam(A)", "unknown function 'spam'; there are exp, log"),
        ("exp()", "exp has 0 arguments; expected 1 at column 1"),
        ("A + pow(2)", "pow has 1 arguments; expected 2 at column 5"),
        ("piecewise(1, A > 3)", "piecewise has 2 arguments; expected value, condition"),
        ("exp", "'exp' is a function"),
        ("A ^ 2", r"\^ is no power here; write \*\*"),
        ("A if B else 2", "an operator is missing at column 3"),
        ("A.b", "'.' means nothing at column 2"),
        ("__import__('os')", "unknown function '__import__'"),
        ("[A for A in B]", "means nothing at column 1"),
        ("exp(x=1)", "an operator is missing at column 6"),
        ("A // 2", "an operator is missing at column 3"),
        ("A is B", "an operator is missing at column 3"),
        ("1e999 * A", "a number beyond 1e308"),
        ("10000" + 400 * "0", "a number beyond 1e308"),
        ("2j", "an operator is missing at column 2"),
        ("True", "'True' is not a name here"),
        ("(A + 1", "this bracket is never closed at column 1"),
        ("A + 1)", "a bracket closes that was never opened at column 6"),
        ("A, B", "a comma outside of a function's arguments at column 2"),
        ("(A, B)", "a comma outside of a function's arguments"),
        ("A + not B", "'not' needs brackets here at column 5"),
        ("A 'B'", "an operator is missing"),
        ("'' + A", "an empty name at column 1"),
        ("max(A,)", "a value is missing at column 7"),
        ("A => B", "=> is not read"),
        ("-" * 3000, "a value is missing at column 3001"),
        ("A +" * 40_000 + "A", "at most 100000 are read"),
    ],
)
def test_bad_expressions_are_refused_with_the_place(text, message):
    with pytest.raises(ValueError, match=message):
        Expression(text)


def test_bad_parameters():
    for bad in (np.inf, np.nan, "2", True, None):
        with pytest.raises(ValueError, match=r"parameter 'k' = .*; expected a finite number"):
            Expression("k * A", {"k": bad})
    with pytest.raises(ValueError, match="cannot be called 't': that is the time"):
        Expression("t * A", {"t": 2.0})


def test_quoted_names_and_print():
    law = Expression("k * 'A-B' * 't'", {"k": 2.0, "unused": 3.0})
    assert law.species == ("A-B", "t")
    assert not law.reads_time
    assert str(law) == "k * 'A-B' * 't'  (k = 2)"
    assert evaluate(steps_of(law, {"A-B": 0, "t": 1}), np.array([3, 5]), 1.0) == 30.0
    with pytest.raises(AttributeError):
        law.text = "A"


# Random expressions: both machines against Python itself, and bounds against values.

LEAVES = st.one_of(st.sampled_from(["A", "B", "t", "pi"]), st.floats(-9, 9).map(repr), st.integers(0, 5).map(str))


FUNCTIONS = ("sqrt", "abs", "floor", "ceil")  # right to the last bit everywhere
ROUNDED = ("exp", "log", "sin", "cos")


def texts(functions, has_powers):
    """Random expressions."""

    def larger(inner):
        pair = st.tuples(inner, inner)
        kinds = [
            st.tuples(inner, st.sampled_from("+-*/%"), inner).map(lambda p: f"({p[0]} {p[1]} {p[2]})"),
            st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(lambda p: f"{p[0]}({p[1]}, {p[2]})"),
            st.tuples(st.sampled_from(functions), inner).map(lambda p: f"{p[0]}({p[1]})"),
            st.tuples(inner, inner, inner, inner, st.sampled_from(["<", "<=", ">", "!=", "=="])).map(
                lambda p: f"piecewise({p[0]}, {p[1]} {p[4]} {p[2]} and not ({p[3]} < 1), {p[2]})"
            ),
        ]
        if has_powers:
            kinds.append(st.tuples(inner, st.integers(0, 3)).map(lambda p: f"({p[0]}) ** {p[1]}"))
            kinds.append(pair.map(lambda p: f"pow(abs({p[0]}), {p[1]})"))
        return st.one_of(kinds)

    return st.recursive(LEAVES, larger, max_leaves=8)


def check_bounds(text, counts, since, width, bounds=bounds):
    expression = Expression(text)
    until = since + width
    low, high = bounds(expression, counts, since, until)
    assert low <= high
    for share in np.linspace(0.0, 1.0, 23):
        found = by_machine(expression, counts, min(since + share * width, until))
        assert np.isnan(found) or low <= found <= high, f"{text} is {found} outside of {low} to {high}"


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    texts(FUNCTIONS + ROUNDED, has_powers=True),
    st.tuples(st.integers(0, 20), st.integers(0, 3)),
    st.floats(0, 50),
    st.floats(1e-9, 30),
)
def test_bounds_hold_on_random_expressions(text, counts, since, width):
    check_bounds(text, counts, since, width)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(texts(FUNCTIONS, has_powers=False), st.tuples(st.integers(0, 20), st.integers(0, 3)), st.floats(0, 50))
def test_both_machines_agree_to_the_last_bit(text, counts, time):
    expression = Expression(text)
    states = np.array([counts, counts])
    here = evaluate(steps_of(expression, PLACES), states, time)
    assert_array_equal(here, 2 * [by_machine(expression, counts, time)])


@pytest.mark.parametrize("text", ["t", "sin(t)", "A * exp(t / 10)", "1 / (t + 1)", "piecewise(2, t > 3, 1)"])
def test_the_check_sees_bounds_that_are_too_small(text):
    check_bounds(text, (3, 1), 0.5, 4.0)
    with pytest.raises(AssertionError, match="outside of"):
        check_bounds(text, (3, 1), 0.5, 4.0, lambda *what: (bounds(*what)[0], 0.999 * bounds(*what)[1]))


@pytest.mark.parametrize(
    ("text", "since", "until", "expected"),
    [
        ("1 + 0.5 * sin(2 * pi * t / 24)", 0.0, 1.0, (1.0, 1 + 0.5 * math.sin(2 * math.pi / 24))),
        ("sin(t)", 1.0, 2.0, (math.sin(1.0), 1.0)),
        ("cos(t)", 3.0, 7.0, (-1.0, 1.0)),
        ("piecewise(5, t < 3, 7)", 0.0, 2.0, (5.0, 5.0)),
        ("piecewise(5, t < 3, 7)", 2.0, 4.0, (5.0, 7.0)),
        ("t % 12", 13.0, 14.0, (1.0, 2.0)),
        ("t % 12", 11.0, 13.0, (0.0, 12.0)),
        ("(t - 2) ** 2", 1.0, 4.0, (0.0, 4.0)),
        ("(t - 5) ** 3", 1.0, 4.0, (-64.0, -1.0)),
        ("abs(t - 2)", 1.0, 4.0, (0.0, 2.0)),
        ("A * (A - 1) * exp(-t)", 0.0, 1.0, (6 * math.exp(-1), 6.0)),
    ],
)
def test_bounds_are_tight(text, since, until, expected):
    assert_allclose(bounds(Expression(text), (3, 1), since, until), expected, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("text", ["1 / (t - 2)", "log(t - 2)", "sqrt(t - 2)", "exp(1e6 * t)", "(t - 2) ** -1"])
def test_what_has_no_bound_has_none(text):
    assert bounds(Expression(text), (0, 0), 1.0, 3.0)[1] == np.inf


# Laws by name.


def test_named_laws():
    assert len(set(LAWS)) == 7
    at = {"A": 0, "B": 1}

    def law(expression, counts, time=0.0):
        return float(evaluate(steps_of(expression, at), np.array(counts), time))

    assert law(mass_action(0.3, {"A": 3, "B": 1}), (5, 4)) == pytest.approx(0.3 * 10 * 4)
    assert law(michaelis_menten("A", 2.0, 3.0), (7, 0)) == pytest.approx(1.4)
    assert law(michaelis_menten("A", 2.0, 3.0, enzyme="B"), (7, 5)) == pytest.approx(7.0)
    assert law(hill("A", 2.0, 3.0, 4, basal=0.5), (3, 0)) == pytest.approx(1.5)
    assert law(hill_repression("A", 2.0, 3.0, 4), (6, 0)) == pytest.approx(2 / 17)
    steps = steps_in_count("A", [5, 10], [1.0, 2.0, 3.0])
    assert [law(steps, (n, 0)) for n in (4, 5, 9, 10)] == [1.0, 2.0, 2.0, 3.0]
    timed = steps_in_time([2.0, 4.0], [1.0, 0.0, 3.0], {"A": 2})
    assert [law(timed, (4, 0), t) for t in (1.9, 2.0, 4.0)] == [6.0, 0.0, 18.0]
    wave = periodic(2.0, 0.5, 24.0, {"A": 1}, peak=6.0)
    assert [law(wave, (3, 0), t) for t in (6.0, 18.0)] == pytest.approx([9.0, 3.0])
    assert mass_action(1.0, {"A-B": 2}).text == "k * 'A-B' * ('A-B' - 1) / 2"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: michaelis_menten("A", -1.0, 2.0), "vmax = -1.0; expected a finite number of at least 0"),
        (lambda: michaelis_menten("A", 1.0, 0.0), "K = 0.0; expected a finite number above 0"),
        (lambda: hill("A", 1.0, 1.0, np.nan), "n = nan"),
        (lambda: steps_in_count("A", [5, 3], [1, 2, 3]), "counts must rise"),
        (lambda: steps_in_time([5], [1], {}), "1 times and 1 rates; expected one more rate"),
        (lambda: steps_in_time([5], [1, -1], {}), "rates = -1"),
        (lambda: periodic(1.0, 1.5, 24.0, {}), "amplitude = 1.5; expected between 0 and 1"),
        (lambda: mass_action(1.0, {"A": 0}), "0 copies of 'A'"),
    ],
)
def test_bad_arguments_of_named_laws(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("bracket", ["(1 < {} < 3)", "exp(-{})", "({} + 1) * ({} + 1)"])
def test_work_is_in_proportion_to_the_text(bracket):
    """What occurs twice is computed once; as a tree, each level of two of these doubles it."""
    text, steps = "A", []
    for _ in range(40):
        text = bracket.replace("{}", text, 1).replace("{}", "A")
        steps.append(len(steps_of(Expression(text), PLACES)))
    assert steps[-1] - steps[-2] == steps[5] - steps[4] <= 10


def test_what_occurs_twice_has_the_same_value():
    law = hill("A", vmax=2.0, K=10.0, n=2.5, basal=0.1)
    steps = steps_of(law, PLACES)
    assert [step.code for step in steps].count(Code.POWER) == 1
    assert [step.code for step in steps].count(Code.RECALL) == 1
    expected = 0.1 + 2.0 * 7**2.5 / (10**2.5 + 7**2.5)
    assert_allclose([float(evaluate(steps, np.array([7, 2]), 0.0)), by_machine(law, (7, 2), 0.0)], expected, rtol=1e-15)
    timed = "(t - 1) * (t - 1) / ((t - 1) * (t - 1) + 1)"
    low, high = bounds(Expression(timed), (0, 0), 2.0, 3.0)
    assert low <= 0.5
    assert high >= 0.8


@settings(max_examples=200, deadline=None, derandomize=True)
@given(texts(FUNCTIONS + ROUNDED, has_powers=True), st.tuples(st.integers(0, 20), st.integers(0, 3)))
def test_an_expression_of_nodes_has_a_text_of_the_same_value(text, counts):
    law = Expression(text)
    again = Expression(Expression.of(law.formula).text)
    found = [float(evaluate(steps_of(each, PLACES), np.array(counts), 1.7)) for each in (law, again)]
    assert_array_equal(found[0], found[1])


def test_a_long_text_names_its_parts():
    graph = Graph()
    whole = graph.name("x2")
    for _ in range(40):
        whole = graph.add(Code.ADD, (whole, whole))
    law = Expression.of(graph.formula(whole))
    assert law.text.startswith("x1 = x2 + x2; x2_ = x1 + x1; x3 = x2_ + x2_; ")
    assert len(law.text) < 700
    assert float(evaluate(steps_of(law, {"x2": 0}), np.array([3]), 0.0)) == 3 * 2.0**40
    assert pickle.loads(pickle.dumps(law)) == law


def test_nodes_are_counted():
    graph = Graph(most=10)
    with pytest.raises(BudgetError, match="the formulas grow to over 10 operations"):
        node_of("A + 1 + 2 + 3 + 4 + 5", graph)
    graph = Graph(most=10)
    place = node_of("A + 1 + 2", graph)  # of five nodes
    graph.formula(place)
    with pytest.raises(BudgetError):
        graph.formula(place)


def test_zeros_keep_their_sign():
    assert value("1 / (-0.0 + A) + 0.0 * B", (0, 1)) == np.inf
    graph = Graph()
    assert graph.number(0.0) != graph.number(-0.0)
