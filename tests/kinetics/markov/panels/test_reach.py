"""Limits beyond which a look is out of reach: never too narrow, by exact chains, and no wider than they need be."""

import numpy as np
import pytest

from kinetics import Model, Network
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun, moving_windows, reach
from kinetics.markov.panels.panel_step import reach_of
from kinetics.markov.transient.states import StateSpace

MOST = 80  # copies, beyond which these networks are cut
LEFT_OUT = 1e-4  # in the place of 1e-17, so that chains known to 1e-13 can tell
FALLING = {
    "one by one": "A -> 0, 0.7",
    "two at once": "2 A -> 0, 0\nA -> 0, 0.3\nA -> B, 0.5",
    "with gains": "A -> 0, 0.7\n0 -> A, 3",
    "at two rates": "A -> 0, 0.2\nB -> 0, 0.9\nA -> B, 0.3",
}
RISING = {
    "one by one": "A -> 2 A, 0.4",
    "from nothing": "0 -> A, 4",
    "both": "A -> 2 A, 0.3\n0 -> A, 2",
    "two at once": "A -> 3 A, 0.2\n0 -> 2 A, 1\nA -> 2 A, 0.1",
    "with losses": "A -> 2 A, 0.4\nA -> 0, 0.3",
}


def of_look(text, time, seen, columns=None):
    """The limits before a look, and the network."""
    network = Network.from_text(text)
    columns = columns or {"A": {"A": 1}}
    data = PanelData(columns, [PanelRun(np.zeros(len(network.species), dtype=int), [time], [seen])])
    return network, reach_of(network, data, data.runs[0], 0).out_of_reach(time)


def chances_of(network, time, seen, states):
    """The probability to be where `seen` (N,) is true after a time, from each of the states (N, S), by scipy."""
    from scipy.sparse.linalg import expm_multiply

    moves = StateSpace(network, states, np.zeros(len(states), dtype=bool)).transitions()
    inside = moves._replace(leaks=np.zeros(len(states)))  # what would leave the states goes nowhere
    return expm_multiply(time * inside.generator(), seen.astype(float))


@pytest.mark.parametrize("time", [0.05, 0.5, 2.0])
@pytest.mark.parametrize("seen", [0, 3, 20])
@pytest.mark.parametrize("name", FALLING)
def test_what_is_too_much_hardly_falls_so_far(monkeypatch, name, seen, time):
    monkeypatch.setattr(reach, "NEGLIGIBLE", LEFT_OUT)
    both = "B" in FALLING[name]
    columns = {"all": {"A": 1, "B": 1}} if both else None
    network, is_out = of_look(FALLING[name], time, [seen], columns)
    size = 40 if both else MOST + 1
    states = np.indices((size,) * len(network.species)).reshape(len(network.species), -1).T
    total = states.sum(axis=1)
    chances = chances_of(network, time, total <= seen, states)
    judged = (total < 60) & (states.max(axis=1) < size - 10)  # far from where the chain is cut
    out = is_out(states) & judged & (total > seen)
    assert chances[out].max(initial=0.0) <= LEFT_OUT
    if seen > 0 and time < 2.0:
        assert out.any()


@pytest.mark.parametrize("time", [0.05, 0.5, 2.0])
@pytest.mark.parametrize("seen", [3, 20, 60])
@pytest.mark.parametrize("name", RISING)
def test_what_is_too_little_hardly_rises_so_far(monkeypatch, name, seen, time):
    monkeypatch.setattr(reach, "NEGLIGIBLE", LEFT_OUT)
    network, is_out = of_look(RISING[name], time, [seen])
    states = np.arange(MOST + 1)[:, None]
    chances = chances_of(network, time, states[:, 0] >= seen, states)
    out = is_out(states) & (states[:, 0] < seen)
    assert chances[out].max(initial=0.0) <= LEFT_OUT
    if seen == 60 and time < 2.0:
        assert out.any()


@pytest.mark.parametrize(("text", "start", "seen"), [("A -> 0, 0.7", 60, 20), ("A -> 2 A, 0.4", 10, 40)])
def test_limits_for_slower_channels_would_be_too_narrow(monkeypatch, text, start, seen):
    """A control: with rates of half the size, states are left out that lead to the look."""
    monkeypatch.setattr(reach, "NEGLIGIBLE", LEFT_OUT)
    network, _ = of_look(text, 1.0, [seen])
    half = network.with_rates(0.5 * network.known_rates)
    data = PanelData({"A": {"A": 1}}, [PanelRun([0], [1.0], [[seen]])])
    is_out = reach_of(half, data, data.runs[0], 0).out_of_reach(1.0)
    states = np.arange(4 * MOST + 1)[:, None]
    rises = start < seen
    chances = chances_of(network, 1.0, states[:, 0] >= seen if rises else states[:, 0] <= seen, states)
    assert chances[is_out(states) & ((states[:, 0] < seen) == rises)].max() > LEFT_OUT


@pytest.mark.parametrize("time", [0.1, 1.0])
def test_limits_are_nearly_as_close_as_they_can_be(time):
    """Of a pure death process the exact quantile; Chernoff's bound loses a power of the count."""
    from scipy.stats import binom

    _, is_out = of_look("A -> 0, 0.7", time, [50])
    counts = np.arange(50, 400)
    first = int(counts[is_out(counts[:, None])][0])
    exact = binom.cdf(50, counts, np.exp(-0.7 * time))
    assert exact[first - 50] <= 1e-17
    assert exact[first - 50] > 1e-20
    assert exact[first - 60] > 1e-17


def test_what_never_falls_has_a_limit_at_any_time():
    network = Network.from_text("A -> B, 1\nB -> 2 B, 2")
    data = PanelData({"A": {"A": 1}, "B": {"B": 1}}, [PanelRun([5, 0], [1.0], [[2, 4]])])
    is_out = reach_of(network, data, data.runs[0], 0).out_of_reach(np.inf)
    states = np.array([(2, 4), (3, 3), (1, 4), (2, 5), (9, 0)])
    assert is_out(states).tolist() == [False, False, True, True, True]  # all together, they never fall


def test_channels_of_two_reactants_and_laws_have_no_limit():
    for text in ("A + B -> 0, 0.01", "A -> 0, k*A; k = 1"):
        network = Network.from_text(text.partition(";")[0], **({"k": 1.0} if "k" in text else {}))
        data = PanelData({"A": {"A": 1}}, [PanelRun(np.ones(len(network.species), dtype=int), [1.0], [[1]])])
        states = np.full((1, len(network.species)), 10**6)
        assert not reach_of(network, data, data.runs[0], 0).out_of_reach(1.0)(states).any()


def test_the_event_at_a_look_and_recorded_channels_count():
    """Between two looks a recorded channel does not fire; at the look its event takes one."""
    network = Network.from_text("die: A -> 0, 5\nborn: 0 -> A, 2")
    run = PanelRun([3], [1.0], [[2]], fired=[0])
    data = PanelData({"A": {"A": 1}}, [run], events=[("die",)])
    is_out = reach_of(network, data, run, 0).out_of_reach(np.inf)
    assert is_out(np.array([[2], [3], [4]])).tolist() == [False, False, True]


def test_windows_without_states_out_of_reach_agree(monkeypatch):
    """Prey and predators, all states kept: the same number, within the bounds of both."""
    monkeypatch.setattr(moving_windows, "EXPLORED", 1)
    network = Network.from_text("birth: X -> 2 X, 1\npredation: X + Y -> 2 Y, 0.05\ndeath: Y -> 0, 0.6")
    data = PanelData({"X": {"X": 1}, "Y": {"Y": 1}}, [PanelRun([10, 8], [1.0, 2.0], [[14, 9], [12, 14]])])
    found = PanelLikelihood(Model.of(network), data).value()
    monkeypatch.setattr(reach.Reach, "out_of_reach", lambda *_: lambda states: np.zeros(len(states), dtype=bool))
    whole = PanelLikelihood(Model.of(network), data).value()
    assert found.is_bound
    assert whole.is_bound
    assert abs(found.value - whole.value) <= found.error + whole.error
    assert found.error < 1e-8


def test_a_look_many_events_away_is_found_in_one_window(monkeypatch):
    """One window over the whole time, which at first goes fewer events than the look is away."""
    from scipy.stats import poisson

    monkeypatch.setattr(moving_windows, "EXPLORED", 1)
    network = Network.from_text("0 -> A, 40")
    found = PanelLikelihood(Model.of(network), PanelData({"A": {"A": 1}}, [PanelRun([0], [1.0], [[85]])])).value()
    assert found.value == pytest.approx(poisson.logpmf(85, 40.0), abs=found.error)
    assert found.is_bound
