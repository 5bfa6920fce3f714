"""Likely states that move, and those that matter to both ends: against all states, closed forms and false bounds."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import poisson

from kinetics import Model, Network
from kinetics.markov.panels import (
    PanelData,
    PanelLikelihood,
    PanelRun,
    bridges,
    few_states,
    likelihood,
    moving_windows,
    run_pass,
)
from kinetics.markov.panels.observations import Detected, Rounded

BOX = 22  # of each of two species; what these networks hold beyond has a probability below 1e-12
TURNOVER = "make: 0 -> A, v\nlose: A -> 0, g"
HIDDEN = "ab: A -> B, k\nbc: B -> C, q\nca: C -> A, 1.4\nbond: A + B <-> D, 0.05, 0.4"


@pytest.fixture
def windows(monkeypatch):
    """All networks are cut into short windows over likely states."""
    monkeypatch.setattr(few_states, "MOST_STATES", 1)
    monkeypatch.setattr(moving_windows, "EXPLORED", 1)
    monkeypatch.setattr(moving_windows, "STEPS", 6.0)
    monkeypatch.setattr(moving_windows, "FIRST_LAYERS", 5)


def hidden(with_events):
    """Two columns with holes, one of two species, in two runs."""
    seen = [[1, 3], [np.nan, 4], [2, np.nan], [0, 3]]
    fired = [-1, 0, -1, 0] if with_events else None
    runs = [PanelRun([4, 1, 0, 1], [0.6, 1.1, 2.5, 3.0], seen, fired=fired), PanelRun([3, 2, 0, 0], [1.5], [[1, 2]])]
    columns = {"C": {"C": 1}, "ab": {"A": 1, "B": 1, "D": 2}}
    return PanelData(columns, runs, {"C": Detected(0.8), "ab": Rounded(2.0)}, [("ca", "bond")] if with_events else [])


@pytest.mark.parametrize("with_events", [False, True])
def test_windows_and_bridges_are_the_chain_of_all_states(with_events, request):
    model, names = Model.of(Network.from_text(HIDDEN, k=0.7, q=1.3)), ["k", "q", "bond", "C"]
    every = PanelLikelihood(model, hidden(with_events)).scored({}, names)
    request.getfixturevalue("windows")
    asked = PanelLikelihood(model, hidden(with_events))
    assert asked.value().value == pytest.approx(every.answer.value, abs=1e-9)
    found = asked.scored({}, names)
    (steps,) = {id(steps): steps for steps in asked._known.values()}.values()
    assert any(step.look < 0 for step in steps.steps[0, 0])
    assert found.answer.kind == "estimate"
    assert found.answer.value == pytest.approx(every.answer.value, abs=1e-9)
    np.testing.assert_allclose(found.gradient, every.gradient, rtol=1e-8)


def test_what_cannot_lead_to_a_look_is_not_counted_as_lost(request):
    """In an outbreak susceptible people never become more: where too few are left, nothing comes back."""
    model = Model.of(Network.from_text("infect: S + I -> 2 I, 0.02\nremove: I -> R, 3"))
    data = PanelData({"S": {"S": 1}, "I": {"I": 1}}, [PanelRun([60, 7, 0], [0.5, 0.9], [[56, 4], [54, 3]])])
    every = PanelLikelihood(model, data).value()
    request.getfixturevalue("windows")
    found = PanelLikelihood(model, data).value()
    assert found.kind == "proven"
    assert found.low <= every.value <= found.high
    assert found.error < 1e-8


def false_bounds(seeds):
    """Of random networks that make, turn and lose two species, seen twice, at first in part: how many bounds fail."""
    failed, widest = 0, 0.0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        rates = 10.0 ** rng.uniform(-0.5, 0.3, 5)
        text = "0 -> A, {}\nA -> 0, {}\nA -> B, {}\nB -> 0, {}\nA + B -> 2 B, {}"
        network = Network.from_text(text.format(*(float(rate) for rate in rates * [0.5, 1, 1, 1, 0.1])))
        states = np.indices((BOX, BOX)).reshape(2, -1).T
        generator = np.zeros((BOX**2, BOX**2))
        for r, change in enumerate(network.stoichiometry):
            there = states + change
            inside = ((there >= 0) & (there < BOX)).all(axis=1)
            rows, columns = np.flatnonzero(inside), there[inside] @ [BOX, 1]
            generator[rows, columns] += network.propensities(states)[inside, r]
        np.fill_diagonal(generator, generator.diagonal() - generator.sum(axis=1))
        first, last = int(rng.integers(0, 3)), rng.integers(0, 3, 2)
        run = PanelRun([1, 0], [0.4, 0.9], [[first, np.nan], last])
        now = expm(0.4 * generator)[states.tolist().index([1, 0])] * (states[:, 0] == first)
        exact = np.log((now @ expm(0.5 * generator))[last @ [BOX, 1]])
        found = PanelLikelihood(Model.of(network), PanelData({s: {s: 1} for s in network.species}, [run])).value()
        assert found.kind == "proven"
        failed += not found.low <= exact <= found.high
        widest = max(widest, found.error)
    return failed, widest


def coarse(monkeypatch):
    """So much is lost that the bounds are wide, and no wider than that."""
    monkeypatch.setattr(moving_windows, "LOST_AT_MOST", 1e-4)
    monkeypatch.setattr(moving_windows, "SPARE_LAYERS", 0)


@pytest.mark.parametrize("networks", [20, pytest.param(300, marks=pytest.mark.validate)])
def test_no_bound_is_false_where_much_is_lost(windows, monkeypatch, networks):
    coarse(monkeypatch)
    failed, widest = false_bounds(range(networks))
    assert failed == 0
    assert widest > 1e-4


def test_bounds_without_what_was_lost_would_be_false(windows, monkeypatch):
    coarse(monkeypatch)
    monkeypatch.setattr(run_pass, "amplified", lambda *_: np.zeros(()))
    failed, _ = false_bounds(range(20))
    assert failed > 10


def law_of(v, g, run):
    return poisson.logpmf(run.seen[0, 0], v / g * (1 - np.exp(-g * run.times[0])))


def test_bridges_are_found_anew_at_rates_far_from_the_first(windows):
    """Made at rate v and lost at rate g, from none: Poisson, with mean v / g (1 - exp(-g t))."""
    run = PanelRun([0], [2.0], [[12]])
    asked = PanelLikelihood(Model.of(Network.from_text(TURNOVER, v=8.0, g=0.5)), PanelData({"A": {"A": 1}}, [run]))
    for v, g in ((8.0, 0.5), (8.4, 0.52), (30.0, 2.0), (11.0, 0.1)):
        found = asked.scored({"v": v, "g": g}, ["v", "g"])
        assert found.answer.value == pytest.approx(law_of(v, g, run), abs=2e-6)
        assert abs(found.answer.value - law_of(v, g, run)) < found.answer.error
        slopes = [
            (law_of(v * (1 + up), g * (1 + to), run) - law_of(v * (1 - up), g * (1 - to), run)) / 2e-5
            for up, to in ((1e-5, 0), (0, 1e-5))
        ]
        np.testing.assert_allclose(found.gradient, slopes, atol=2e-5)


def test_bridges_stay_where_a_look_is_too_unlikely(windows):
    run = PanelRun([0], [2.0], [[12]])
    asked = PanelLikelihood(Model.of(Network.from_text(TURNOVER, v=8.0, g=0.5)), PanelData({"A": {"A": 1}}, [run]))
    asked.scored({}, ["v"])
    found = asked.scored({"v": 400.0}, ["v"])
    assert found.answer.value < -200
    assert found.gradient[0] < -100  # it says where to go from here
    with pytest.raises(ValueError, match="below 1e-17 at these rates; begin with other values"):
        asked.value({"v": 4000.0})


def worst_bridge(looks):
    """Copies that are made and lost, from none to some after a time: how far bridges are off the Poisson law."""
    turnover, worst = Network.from_text(TURNOVER, v=2.0, g=0.5), 0.0
    for time, n in looks:
        data = PanelData({"A": {"A": 1}}, [PanelRun([0], [time], [[n]])])
        found = PanelLikelihood(Model.of(turnover), data).scored({}, ["v", "g"])
        assert found.answer.kind == "estimate"
        law = lambda v, g, time=time, n=n: poisson.logpmf(n, v / g * (1 - np.exp(-g * time)))  # noqa: E731
        slopes = [
            (law(2 * np.exp(h * a), 0.5 * np.exp(h * b)) - law(2 * np.exp(-h * a), 0.5 * np.exp(-h * b))) / (2 * h)
            for a, b in ((1, 0), (0, 1))
            for h in (1e-5,)
        ]
        worst = max(worst, abs(found.answer.value - law(2.0, 0.5)), *np.abs(found.gradient - slopes))
    return worst


def test_bridges_hold_what_lies_between_two_known_states(monkeypatch):
    """One step from a state to another, which leads through many: with the control that looks at its ends alone."""
    assert worst_bridge([(0.3, 0), (1.0, 0), (1.0, 3), (1.0, 9), (4.0, 1), (4.0, 12)]) < 1e-8
    monkeypatch.setattr(bridges, "PARTS", 1)
    monkeypatch.setattr(likelihood, "MOST_MISSED", np.inf)
    assert worst_bridge([(1.0, 0), (1.0, 3)]) > 1e-4
