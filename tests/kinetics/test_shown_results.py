"""Results show themselves: a line, a table, HTML, a figure; and wrong use from Python says what was expected."""

import ast

import matplotlib.pyplot as plt
import numpy as np
import pytest
from known_systems import line
from matplotlib.axes import Axes
from test_arrows import SOURCES

from kinetics import (
    Direct,
    Network,
    Transient,
    first_passage,
    predict,
    sample_path,
    simulate,
    simulate_statistics,
    solve,
)

TIMES = np.linspace(0.0, 500.0, 26)
START = [30, 0, 0, 0]
RESULTS = {
    "network": line,
    "runs": lambda: simulate(line(), "ssa", START, TIMES, runs=40),
    "statistics": lambda: simulate_statistics(line(), "auto", START, TIMES, runs=40),
    "distribution": lambda: solve(line(), "exact", [8, 0, 0, 0], TIMES),
    "prediction": lambda: predict(line(), None, START, TIMES, "lockstep", runs=40),
}


@pytest.fixture(autouse=True)
def _figures_closed():
    yield
    plt.close("all")


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_a_line_a_table_and_html(name):
    result = RESULTS[name]()
    assert repr(result).startswith(f"<{type(result).__name__}: ")
    assert "\n" not in repr(result)
    table = str(result)
    assert len(table.splitlines()) >= 3
    assert max(map(len, table.splitlines())) < 200
    assert "quadmer" in table
    html = result._repr_html_()
    assert html.count("<tr>") == len(result.summary().rows) + 1
    if name != "network":
        assert len(result.summary().rows) <= 11
        assert result.summary().rows[0][0] == "0"


def test_a_line_costs_no_statistics(monkeypatch):
    """What a debugger asks for at every step must not go through all counts, nor fail where there are none."""
    runs = RESULTS["runs"]()
    monkeypatch.setattr(type(runs), "mean", lambda self: pytest.fail("went through the counts"))
    assert repr(runs) == "<Ensemble: 40 runs of 4 species at 26 times>"


def test_names_cannot_bring_html_of_their_own():
    hostile = Network.from_reactions({"<b>r</b>": ({}, {"<script>": 1})}, [1.0])
    for result in (hostile, simulate(hostile, "ssa", [0], [1.0], runs=3)):
        assert "<script>" not in result._repr_html_()
        assert "&lt;script&gt;" in result._repr_html_()


@pytest.mark.parametrize("name", [name for name in RESULTS if name != "network"])
def test_a_figure_needs_no_axes(name):
    result = RESULTS[name]()
    drawn = result.plot()
    assert isinstance(drawn, Axes)
    given = plt.figure().add_subplot()
    assert result.plot(given) is given
    assert result.plot(ax=given) is given


def test_other_results_need_none_either():
    assert isinstance(first_passage(line(), [8, 0, 0, 0], "quadmer").plot(), Axes)
    assert isinstance(sample_path(line(), START, 100.0).plot(), Axes)


def without_decorator(source):
    """Methods `plot(self, ax, ...)` that cannot be called without axes."""
    return [
        node.lineno
        for kind in ast.walk(ast.parse(source))
        if isinstance(kind, ast.ClassDef)
        for node in kind.body
        if isinstance(node, ast.FunctionDef)
        and node.name == "plot"
        and [each.arg for each in node.args.args[:2]] == ["self", "ax"]
        and "on_axes" not in [ast.unparse(each) for each in node.decorator_list]
    ]


def test_every_plot_makes_its_own_axes():
    assert without_decorator("class A:\n    def plot(self, ax):\n        pass\n") == [2]  # the control
    assert {path.name: without_decorator(path.read_text("utf-8")) for path in SOURCES} == {
        path.name: [] for path in SOURCES
    }


def test_runs_by_species_and_by_times():
    runs = RESULTS["runs"]()
    np.testing.assert_array_equal(runs["dimer"], runs.counts[:, :, 1])
    part = runs[100:200]
    assert part.times.tolist() == [100.0, 120.0, 140.0, 160.0, 180.0, 200.0]
    np.testing.assert_array_equal(part.counts, runs.counts[:, 5:11])
    np.testing.assert_array_equal(runs[:].counts, runs.counts)
    with pytest.raises(ValueError, match="no time from 501 to inf; there are times from 0 to 500"):
        runs[501:]
    with pytest.raises(ValueError, match="unknown species 'AB'"):
        runs["AB"]
    with pytest.raises(TypeError, match="expected a species"):
        runs[3]


def test_methods_by_name_are_those_by_object():
    by_name, by_object = (simulate(line(), each, START, TIMES, runs=5, seed=2) for each in ("ssa", Direct()))
    np.testing.assert_array_equal(by_name.counts, by_object.counts)
    exact = solve(line(), "exact", [8, 0, 0, 0], [10.0]), solve(line(), Transient(), [8, 0, 0, 0], [10.0])
    np.testing.assert_array_equal(exact[0].probabilities, exact[1].probabilities)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: simulate(line(), "gill", START, [1.0]),
            ValueError,
            "unknown sampling method 'gill'; they are",
        ),
        (lambda: simulate(line(), Direct, START, [1.0]), TypeError, r"expected a sampling method such as Direct\(\)"),
        (lambda: simulate(line(), Transient(), START, [1.0]), TypeError, "expected a sampling method"),
        (lambda: solve(line(), "ssa", START, [1.0]), ValueError, "unknown solving method 'ssa'; they are exact"),
        (lambda: solve(line(), Direct(), START, [1.0]), TypeError, "expected a solving method"),
        (lambda: predict(line(), None, START, [1.0], "cme"), ValueError, "unknown method 'cme'; methods are ssa"),
    ],
)
def test_wrong_methods_are_refused_in_words(call, error, words):
    with pytest.raises(error, match=words):
        call()
