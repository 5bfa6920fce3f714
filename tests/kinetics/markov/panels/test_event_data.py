"""The density of runs in which every event is known: against sums by hand, and against panels that look often."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kinetics import JumpPath, Model, Network, sample_path
from kinetics.markov.panels import (
    EventData,
    EventLikelihood,
    JointLikelihood,
    PanelData,
    PanelLikelihood,
    PanelRun,
    log_probability,
)
from kinetics.runs import RESTART

BINDING = Network.from_text("bind: A + B -> C, k\nloose: C -> A + B, l\nfade: C -> A, m", k=0.1, l=0.3, m=0.2)
TWICE = Network.from_text("dies: A -> 0, k\nkilled: A + B -> B, l", k=0.3, l=0.2)


def by_hand(path, network, causes=None):
    """The log-density, event by event in plain Python."""
    total, before = 0.0, 0.0
    for event, (time, channel) in enumerate(zip(path.times, path.channels, strict=True)):
        rates = network.propensities(path.states[event : event + 1])[0] * path.open_channels
        total -= rates.sum() * (time - before)
        before = time
        if channel != RESTART:
            members = [channel] if causes is None or causes[event] is None else causes[event]
            total += np.log(sum(rates[c] for c in members))
    rates = network.propensities(path.states[-1:])[0] * path.open_channels
    return total - rates.sum() * (path.end - before)


@pytest.mark.parametrize("seed", range(5))
def test_the_density_is_that_by_hand(seed):
    path = sample_path(BINDING, {"A": 6, "B": 4, "C": 0}, end=20.0, seed=seed)
    found = log_probability(path)
    assert found.is_bound
    assert found.low <= by_hand(path, BINDING) <= found.high
    assert found.error < 1e-11 * (1 + abs(found.value))


def test_restarts_and_closed_channels():
    whole = JumpPath(BINDING, {"A": 2, "B": 2}, [1.0, 2.0, 3.5], [0, RESTART, 0], 5.0, np.array([True, True, False]))
    assert log_probability(whole).value == pytest.approx(by_hand(whole, BINDING), abs=1e-13)


def unseen(seed):
    path = sample_path(TWICE, {"A": 8, "B": 2}, end=4.0, seed=seed)
    which = np.where(np.arange(path.times.size) % 3 == 0, -1, 0)
    return path, which, EventData([path], [("dies", "killed")], [which])


def test_hazards_of_unseen_causes_add():
    path, which, data = unseen(4)
    found = EventLikelihood(Model.of(TWICE), data).value()
    assert found.value == pytest.approx(by_hand(path, TWICE, [None if w < 0 else (0, 1) for w in which]), abs=1e-12)
    assert found.value > log_probability(path).value  # the control: naming one of them says more


@pytest.mark.parametrize("names", [["k", "l"], ["dies", "killed"]])
def test_gradients_are_those_of_differences(names):
    _, _, data = unseen(2)
    plain = TWICE if "k" in names else Network.from_text("dies: A -> 0, 0.3\nkilled: A + B -> B, 0.2")
    asked = EventLikelihood(Model.of(plain), data)
    point = dict.fromkeys(names, 0.25)
    gradient, step = asked.scored(point, names).gradient, 1e-6
    for name, slope in zip(names, gradient, strict=True):
        up, down = (asked.value({**point, name: 0.25 * np.exp(sign * step)}).value for sign in (1, -1))
        assert slope == pytest.approx((up - down) / (2 * step), rel=1e-6, abs=1e-8)


def test_a_panel_that_looks_at_every_event_says_the_same():
    """The density of events at known times, by the forward filter."""
    path = sample_path(BINDING, {"A": 3, "B": 2, "C": 0}, end=6.0, seed=3)
    events = [(name,) for name in BINDING.channels]
    times = np.append(path.times, path.end)
    seen = np.concatenate([path.states[1:], path.states[-1:]]).astype(float)
    run = PanelRun(path.initial, times, seen, fired=np.append(path.channels, -1))
    columns = {name: {name: 1.0} for name in BINDING.species}
    panel = PanelLikelihood(Model.of(BINDING), PanelData(columns, [run], events=events)).value()
    assert panel.value == pytest.approx(log_probability(path).value, abs=1e-9)


def test_an_event_of_rate_zero_is_an_error():
    data = EventData([JumpPath(TWICE, {"A": 2}, [1.0], [0], 2.0)])
    with pytest.raises(ValueError, match="dies fired from A 2, where its rate is 0"):
        EventLikelihood(Model.of(TWICE), data).value({"k": 0.0})


def test_causes_that_the_counts_tell_apart_are_refused():
    path = sample_path(BINDING, {"A": 3, "B": 2, "C": 0}, end=6.0, seed=3)
    with pytest.raises(ValueError, match="loose or fade: they change different counts"):
        EventData([path], [("loose", "fade")], [np.zeros(path.times.size, dtype=int)])


def test_a_coarse_clock_is_refused():
    path = JumpPath(TWICE, {"A": 2}, [1.0], [0], 2.0, resolution=0.5)
    with pytest.raises(ValueError, match="give the counts at the times of the looks"):
        EventData([path])


def test_groups_with_parameters_of_their_own_are_sums():
    paths = [sample_path(TWICE, {"A": 8, "B": 2}, end=4.0, seed=seed) for seed in (1, 2)]
    one, two = (EventLikelihood(Model.of(TWICE), EventData([path])) for path in paths)
    both = JointLikelihood({"one": one, "two": two}, own=["k"])
    point = {"k[one]": 0.2, "k[two]": 0.7, "l": 0.4}
    found = both.scored(point, list(point))
    parts = [one.scored({"k": 0.2, "l": 0.4}, ["k", "l"]), two.scored({"k": 0.7, "l": 0.4}, ["k", "l"])]
    assert found.answer.value == pytest.approx(sum(part.answer.value for part in parts), abs=1e-12)
    assert_allclose(
        found.gradient, [parts[0].gradient[0], parts[1].gradient[0], parts[0].gradient[1] + parts[1].gradient[1]]
    )
    assert both.parameters == {"l": 0.2, "k[one]": 0.3, "k[two]": 0.3}
    with pytest.raises(ValueError, match="unknown parameter 'z'"):
        JointLikelihood({"one": one}, own=["z"])
