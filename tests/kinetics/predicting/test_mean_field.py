"""Rate equations in place of the means: closed forms, an independent integration, and what they are off by."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command_line import run_here
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal
from rate_equations import RateEquations as Falling
from scipy.integrate import solve_ivp

from kinetics import ChannelRate, Convention, Model, Network, Rates, predict
from kinetics.network import Crowding
from kinetics.network.laws import Event
from kinetics.predicting import Job
from kinetics.predicting.mean_field import APPROXIMATE, MeanField
from kinetics.predicting.observables import Observables
from kinetics.predicting.rate_equations import RateEquations

TIMES = [0.0, 0.5, 3.0, 20.0]
PAIR = "bind: A + B <-> AB, 0.01, 0.1\nA = 20\nB = 10\n"


def field(text, counts=None, times=TIMES):
    return predict(Model(Network.from_text(text), counts), times=times, method="mean-field")


def test_linear_networks_have_their_exact_means():
    text = "A <-> B, 1.3, 0.4\nB -> C, 0.2\nC -> 0, 0.7"
    made = field(text, {"A": 20})
    exact = predict(Model(Network.from_text(text), {"A": 20}), times=TIMES, method="transient")
    assert_allclose(made.mean, exact.mean, atol=1e-6)
    assert_allclose(made.result.away()[0], 0.0, atol=1e-6)
    grown = field("0 -> A, 5\nA -> 0, 1", {"A": 2})
    assert_allclose(grown.mean[:, 0], 5 - 3 * np.exp(-np.array(TIMES)), rtol=1e-7)
    # control: a pair of reactants is off by far more
    assert abs(field(PAIR).result.away()[0]) > 0.05


@pytest.mark.parametrize(("combinations", "k"), [("distinct", 0.1), ("ordered", 0.05), ("product", 0.05)])
def test_a_pair_that_vanishes_is_off_with_the_known_sign(combinations, k):
    """dA/dt = -2 k' A**2 with k' = 0.05: A = 10 / (1 + t). Runs have fewer pairs, A(A - 1), so more A is left."""
    network = Network.from_reactions({"pair": ({"A": 2}, {})}, [k], combinations=combinations)
    made = predict(Model(network, {"A": 10}), times=TIMES, method="mean-field")
    assert_allclose(made.mean[:, 0], 10 / (1 + np.array(TIMES)), rtol=1e-7)
    off = made.mean - made.result.exact.mean()
    # A * A is larger than the square of the mean, by the variance, and 0 only below two: its sign changes
    if combinations != "product":
        assert (off[1:3, 0] < -0.05).all()
    difference, species, time = made.result.away()
    assert (species, abs(difference)) == ("A", np.abs(off).max())
    assert abs(off[TIMES.index(time), 0]) == np.abs(off).max()
    assert f"difference from the exact mean {difference:+.3g} copies, of A at {time:g}" in made.headline


def test_the_law_of_binding_against_an_independent_integration():
    made = field(PAIR)

    def slope(_, x):
        a, b, ab = x
        flow = 0.01 * a * b - 0.1 * ab
        return [-flow, -flow, flow]

    other = solve_ivp(slope, (0, 20), [20, 10, 0], "Radau", TIMES, rtol=1e-10, atol=1e-10)
    assert_allclose(made.mean, other.y.T, rtol=1e-6, atol=1e-6)
    # docs/kinetics.md: at equilibrium runs have more AB than the rate equations
    assert (made.mean[3] - made.result.exact.mean()[3])[2] < -0.05
    assert made.result.away()[1] == "A"  # of three alike the first


def test_orders_and_rate_laws_against_equations_of_their_own():
    text = "A + 2 B -> C, 0.002\nC -> A, 3 * C / (2 + C)\n0 -> B, 4 + sin(t)\nB -> 0, 0.3"
    network, start = Network.from_text(text), [30, 5, 0]
    made = predict(Model(network, start), times=TIMES, method="mean-field")

    def slope(t, x):
        a, b, c = x
        flow, back = 0.002 * a * b * b / 2, 3 * c / (2 + c)
        return [back - flow, 4 + np.sin(t) - 0.3 * b - 2 * flow, flow - back]

    other = solve_ivp(slope, (0, 20), start, "DOP853", TIMES, rtol=1e-11, atol=1e-11)
    assert_allclose(made.mean, other.y.T, rtol=1e-6, atol=1e-6)
    assert "depends on the time" in made.result.comparison
    # control: with b (b - 1) / 2, as runs have it, the values differ
    falling = Falling(network).solution(start, np.array(TIMES))
    assert np.abs(falling - made.mean).max() > 0.05


def test_a_crowd_changes_mass_action():
    network = Network.from_text("A + A <-> AA, 0.01, 0.1")
    crowding = Crowding([0.0, 0.0], [0.01, 0.01], [[0.0, 2.0], [1.0, 0.0]])
    x = np.array([20.0, 5.0])
    flow = 0.01 * 200 * 2 / (1 - 0.25) - 0.5
    assert_allclose(RateEquations(replace(network, crowding=crowding)).slope(0.0, x), [-2 * flow, flow], rtol=1e-12)
    assert_allclose(RateEquations(network).slope(0.0, x)[1], 0.01 * 200 - 0.5)


def test_it_is_called_an_approximation_everywhere(tmp_path):
    (tmp_path / "pair.rxn").write_text(PAIR, encoding="utf-8")
    words = ["predict", "pair.rxn", "--method", "mean-field", "--times", 1, 30]
    told = run_here(*words, "--csv", "a.csv", "--json", cwd=tmp_path).json
    assert told["method_used"] == "mean-field"
    assert told["mean_field"]["approximation"] == APPROXIMATE
    assert "without a bound" in APPROXIMATE
    assert told["error"] is None
    assert told["runs"] is None
    assert told["sd"][0] == [None] * 3
    assert told["mean_field"]["species"] == "A"
    assert 0.01 < told["mean_field"]["difference"] < 0.2
    assert list(pd.read_csv(tmp_path / "a.csv").columns) == ["time", "species", "mean_field"]
    assert APPROXIMATE in run_here(*words, cwd=tmp_path).out
    sampled = run_here(*words, "--method", "mean-field", "--trajectories", 2, "--json", cwd=tmp_path).json
    assert len(sampled["trajectories"]["runs"]) == 2
    assert run_here("predict", "pair.rxn", "--times", 1, "--runs", 9, "--json", cwd=tmp_path).json["mean_field"] is None


def test_it_is_drawn_over_the_exact_bands_or_alone():
    def labels(made):
        ax = made.plot(Figure().add_subplot())
        dotted = [line for line in ax.lines if line.get_linestyle() == ":" and len(line.get_xdata())]
        assert_array_equal([line.get_ydata() for line in dotted], made.mean.T)
        return [text.get_text() for text in ax.get_legend().get_texts()], len(ax.collections), ax.get_ylabel()

    compared, bands, _ = labels(field(PAIR))
    assert compared == ["A", "B", "AB", "mean", "middle 95 % of runs", "mean field (approximate)"]
    assert bands == 3 + 1  # and that of the legend
    alone = labels(field("0 -> A, 5\nA -> 0, 1"))
    assert alone == (["A", "mean field (approximate)"], 0, "count")


def test_sums_of_counts_and_rates_with_evidence():
    model = Model(Network.from_text(PAIR))
    sums = Observables.of(model.network, {"bound twice": {"AB": 2}})
    solution = MeanField().solve(Job(model, TIMES, sums))
    assert_allclose(solution.values[:, 0], 2 * field(PAIR).mean[:, 2])
    assert_allclose(solution.away()[0], -2 * field(PAIR).result.away()[0], rtol=1e-6)
    rate = ChannelRate(rate=0.1, events=40, exposure=400.0, ways=1)
    rates = Rates(convention=Convention(combinations="distinct"), channels={"decay": rate})
    made = predict(Model(Network.from_text("decay: A -> 0, 1"), {"A": 100}), rates, [10.0], "mean-field")
    assert_allclose(made.mean[0, 0], 100 * np.exp(-10 * 40.5 / 400), rtol=1e-7)
    assert made.low is None
    assert "no interval: the mean field is that at the posterior mean of each rate constant" in made.notes


@pytest.mark.parametrize(
    ("text", "counts", "says"),
    [
        ("0 -> A, piecewise(1, t < 5, 3)", {}, "the law of channel 'r1', .*, jumps"),
        ("A -> 0, floor(A / 2)", {"A": 9}, "jumps"),
        ("A -> B, 2.5 + 0 * A", {"A": 10}, "take 'A' below 0 at 4"),
        ("2 A -> 3 A, 1", {"A": 10}, "cannot be followed beyond 0.2"),
        ("A -> B, k", {"A": 10}, "k"),
    ],
)
def test_what_it_cannot_follow_is_refused_by_name(text, counts, says):
    with pytest.raises(ValueError, match=says):
        field(text, counts)


def test_events_are_refused_by_name_and_long_work_ends():
    network = replace(Network.from_text("A -> 0, 1"), events=(Event("dose", "t >= 2", {"A": "A + 5"}),))
    with pytest.raises(ValueError, match="event 'dose' sets counts"):
        predict(Model(network, {"A": 5}), times=[3.0], method="mean-field")
    cycle = Model(Network.from_text("X -> 2 X, 1\nX + Y -> 2 Y, 0.005\nY -> 0, 0.6"), {"X": 100, "Y": 100})
    with pytest.raises(ValueError, match=r"after 0.1 s; ask for earlier times"):
        predict(cycle, times=[1e9], method=MeanField(max_seconds=0.1))


def test_a_continuous_law_of_two_branches_is_followed():
    made = field("A -> B, max(0, A - 5)", {"A": 10})
    assert_allclose(made.mean[:, 0], 5 + 5 * np.exp(-np.array(TIMES)), rtol=1e-6)


def test_figures_do_not_depend_on_the_grid():
    few, many = field(PAIR, times=[3.0, 20.0]), field(PAIR, times=np.linspace(0, 20, 201))
    assert_allclose(few.mean, many.mean[[30, 200]], rtol=1e-7)
