"""Results show themselves: a line, a table, HTML, a figure; and wrong use from Python says what was expected."""

import ast
import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest
from known_systems import bare_line, line
from matplotlib.axes import Axes

from kinetics import (
    Auto,
    Chain,
    ClassRates,
    Direct,
    Model,
    Network,
    Rates,
    Sensitivity,
    Transient,
    committor,
    first_passage,
    grow,
    predict,
    predict_passage,
    rank,
    rare_event,
    sample_path,
    scan,
    simulate,
    simulate_statistics,
    solve,
    stationary,
    verify,
)
from kinetics.assembly import RuleBook
from kinetics.predicting import count_elasticities
from kinetics.support.shown import Shown, Tabular
from kinetics.trust.accuracy.diagram import measure
from tests.test_arrows import SOURCES

TIMES = np.linspace(0.0, 500.0, 26)
START = [30, 0, 0, 0]
RESULTS = {
    "network": line,
    "runs": lambda: simulate(line(), "ssa", START, TIMES, runs=40),
    "statistics": lambda: simulate_statistics(line(), "auto", START, TIMES, runs=40),
    "distribution": lambda: solve(line(), "transient", [8, 0, 0, 0], TIMES),
    "prediction": lambda: predict(Model(line(), START), None, TIMES, "lockstep", runs=40),
    "path": lambda: sample_path(line(), START, 500.0),
}
SMALL = [8, 0, 0, 0]
BOOK = RuleBook.load("line4")


def small_chain():
    return Chain.of(line(), SMALL)


# results whose table is not one over time
OTHERS = {
    "marginal": lambda: simulate_statistics(line(), "auto", START, TIMES, runs=40).marginal_at("dimer", 500.0),
    "passage": lambda: first_passage(line(), SMALL, "quadmer"),
    "prediction of a passage": lambda: predict_passage(line(), None, SMALL, "quadmer"),
    "rare event": lambda: rare_event(line(), START, lambda states: states[:, 1] * 1.0, 3.0, 50.0, runs=400),
    "stationary distribution": lambda: stationary(line(), SMALL),
    "stationary distribution of a chain": lambda: small_chain().stationary(),
    "committor": lambda: committor(line(), SMALL, {"two": lambda states: states[:, 3] == 2}),
    "chain at times": lambda: small_chain().transient([1.0, 10.0]),
    "derivatives": lambda: Sensitivity(small_chain()).until("quadmer >= 1", by=50.0),
    "elasticities": lambda: count_elasticities(bare_line(), Rates.load("table3"), SMALL, [50.0]),
    "ranking": lambda: rank([BOOK], ClassRates.uniform(0.01), cubes=8, runs=20, horizon=50.0),
    "growth": lambda: grow(BOOK, ClassRates.uniform(0.01), 8, 20.0, runs=2).runs[0],
    "growths": lambda: grow(BOOK, ClassRates.uniform(0.01), 8, 20.0, runs=2),
    "accuracy": lambda: measure("line", line(), SMALL, np.linspace(0.0, 5.0, 6), budget=0.1),
    "verification": lambda: verify(line(), Direct(), SMALL, [5.0], runs=200),
    "first times": lambda: simulate(line(), "ssa", START, 500.0, runs=40, until="quadmer >= 3"),
    "scan": lambda: scan(line(), {"monomer": [4, 8]}, "E[quadmer] @ 50"),
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


@pytest.mark.parametrize("name", OTHERS)
def test_every_other_result_is_a_line_a_table_and_html_as_well(name):
    result = OTHERS[name]()
    assert isinstance(result, Shown)
    assert repr(result) == f"<{type(result).__name__}: {result.headline}>"
    assert "\n" not in repr(result)
    assert len(repr(result)) < 200
    table = result.summary()
    assert {len(row) for row in table.rows} == {len(table.titles)}
    assert len(table.rows) <= 40
    assert table.text.startswith(result.headline)
    assert result._repr_html_().count("<tr>") == len(table.rows) + 1
    assert str(result)
    assert "array(" not in repr(result) + str(result)


def test_auto_says_what_it_chose():
    chosen = Auto().choose(line()).name
    assert chosen != "auto"
    assert simulate(line(), "auto", START, [1.0], runs=3).method == f"auto ({chosen})"
    made = simulate_statistics(line(), "auto", START, [1.0], runs=3)
    assert made.method == f"auto ({chosen})"
    assert repr(made).endswith(f"; method auto ({chosen})>")
    assert simulate(line(), "ssa", START, [1.0], runs=3)[:].method == "ssa"
    assert f"method auto ({chosen});" in predict(Model(line(), START), None, [1.0], runs=3).headline
    both = made.merged(simulate_statistics(line(), "ssa", START, [1.0], runs=3))
    assert both.method == ""


def test_runs_by_labels():
    runs = RESULTS["runs"]().to_xarray()
    assert dict(runs.sizes) == {"run": 40, "time": 26, "species": 4}
    assert runs["time"].attrs == {"units": "tu"}
    raw = RESULTS["runs"]()
    np.testing.assert_array_equal(runs["counts"].sel(species="dimer", time=100.0), raw["dimer"][:, 5])
    made = RESULTS["statistics"]()
    table = made.to_xarray()
    np.testing.assert_array_equal(table["mean"], made.mean())
    np.testing.assert_array_equal(table["quantile"].sel(q=0.5), made.quantile(0.5))
    assert table.attrs == {"runs": 40, "method": made.method}


def test_distributions_by_labels():
    made = RESULTS["distribution"]()
    table = made.to_xarray()
    np.testing.assert_array_equal(table["mean"], made.mean())
    assert (table["low"] <= table["mean"]).all()
    assert (table["mean"] <= table["high"]).all()
    np.testing.assert_allclose(table["probability"].sum("copies"), 1.0, atol=1e-10)
    np.testing.assert_array_equal(table["probability"].sel(species="quadmer")[:, :3], made.marginal("quadmer"))
    predicted = RESULTS["prediction"]()
    np.testing.assert_array_equal(predicted.to_xarray()["sd"], predicted.sd)


@pytest.mark.parametrize("name", ["runs", "statistics", "distribution", "prediction", "path"])
def test_tables_as_parquet(name, tmp_path):
    import pandas as pd

    result = RESULTS[name]()
    path = result.to_parquet(tmp_path / "table.parquet")
    pd.testing.assert_frame_equal(pd.read_parquet(path), result.to_dataframe())


def test_tables_of_passages_and_of_what_stays():
    """They hold what the results give one by one."""
    arrival = OTHERS["passage"]()
    curve = arrival.to_dataframe()
    np.testing.assert_array_equal(curve["probability"], arrival.cdf(curve["time"]))
    assert ((curve["low"] <= curve["probability"]) & (curve["probability"] <= curve["high"])).all()
    assert curve["probability"].iloc[-1] == pytest.approx(0.99 * arrival.probability)
    stays = OTHERS["stationary distribution"]()
    shares = stays.to_dataframe()
    means = (shares["copies"] * shares["probability"]).groupby(shares["species"], sort=False).sum()
    assert list(means.index) == list(line().species)
    np.testing.assert_allclose(means, stays.mean(), rtol=1e-12)


def tables_without_parquet(source):
    """Classes with a method `to_dataframe(self)` that are no `Tabular`."""
    return [
        kind.name
        for kind in ast.walk(ast.parse(source))
        if isinstance(kind, ast.ClassDef)
        and kind.name != "Tabular"
        and "Tabular" not in [ast.unparse(base) for base in kind.bases]
        and [
            node
            for node in kind.body
            if isinstance(node, ast.FunctionDef) and node.name == "to_dataframe" and len(node.args.args) == 1
        ]
    ]


def test_every_table_can_be_parquet():
    assert tables_without_parquet("class A:\n    def to_dataframe(self):\n        pass\n") == ["A"]  # the control
    assert Tabular in type(RESULTS["runs"]()).__mro__
    assert {path.name for path in SOURCES if tables_without_parquet(path.read_text("utf-8"))} == set()


@pytest.mark.parametrize(
    ("name", "use"),
    [
        ("xarray", lambda: RESULTS["runs"]().to_xarray()),
        ("pyarrow", lambda: RESULTS["runs"]().to_parquet("table.parquet")),
        ("pandas", lambda: OTHERS["scan"]().to_dataframe()),
        ("pandas", lambda: RESULTS["runs"]().to_dataframe()),
        ("matplotlib", lambda: RESULTS["runs"]().plot()),
        ("matplotlib", lambda: OTHERS["scan"]().plot()),
    ],
)
def test_a_missing_package_is_told_with_its_version(name, use, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ModuleNotFoundError, match=rf"needs {name}; install it by: pip install '{name}>="):
        use()


def test_a_line_costs_no_statistics(monkeypatch):
    """What a debugger asks for at every step must not go through all counts, nor fail where there are none."""
    runs = RESULTS["runs"]()
    monkeypatch.setattr(type(runs), "mean", lambda self: pytest.fail("went through the counts"))
    assert repr(runs) == "<Ensemble: 40 runs of 4 species at 26 times; method ssa>"


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
    exact = solve(line(), "transient", [8, 0, 0, 0], [10.0]), solve(line(), Transient(), [8, 0, 0, 0], [10.0])
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
        (lambda: solve(line(), "ssa", START, [1.0]), ValueError, "unknown solving method 'ssa'; they are transient"),
        (lambda: solve(line(), Direct(), START, [1.0]), TypeError, "expected a solving method"),
        (
            lambda: predict(Model(line(), START), None, [1.0], "cme"),
            ValueError,
            "unknown method 'cme'; methods are ssa",
        ),
    ],
)
def test_wrong_methods_are_refused_in_words(call, error, words):
    with pytest.raises(error, match=words):
        call()
