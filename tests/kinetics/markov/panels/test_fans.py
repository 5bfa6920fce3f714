"""Looks that begin alike, uncertain starts, and intervals: the same numbers as one by one, and as by `expm`."""

import numpy as np
import pytest
from scipy.stats import binom

from kinetics import Model, Network
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun, fans, few_states, log_likelihood
from kinetics.markov.panels.fans import Cut, FanStep
from kinetics.markov.panels.observations import Censored, Detected, Gaussian, Rounded
from kinetics.sampling import sample_path
from tests.kinetics.markov.panels.test_likelihood import by_expm, cycle, reached

ALL = {name: {name: 1.0} for name in "ABCD"}
NAMES = ["k", "q", "bond"]


@pytest.fixture(autouse=True)
def _many_states(monkeypatch):
    monkeypatch.setattr(few_states, "MOST_STATES", 1)


def frames(seed, runs=6, every=0.3, looks=20, holes=0.0, columns="ABCD"):
    """Runs of `cycle`, watched by a camera that misses some numbers."""
    rng, network, found = np.random.default_rng(seed), cycle().network, []
    for run in range(runs):
        path = sample_path(network, [3, 1, 0, 1], every * looks, 1000 * seed + run)
        seen = path.at(every * np.arange(1, looks + 1)).astype(float)
        seen = seen[:, [network.index(name) for name in columns]]
        seen[rng.random(seen.shape) < holes] = np.nan
        found.append(PanelRun([3, 1, 0, 1], np.round(every * np.arange(1, looks + 1), 6), seen))
    return found


def one_by_one(model, data, point, names):
    """The sum over runs that are cut nowhere, each alone."""
    parts = [PanelLikelihood(model, PanelData(data.columns, [run], data.observations)) for run in data.runs]
    scored = [part.scored(point, names) for part in parts]
    return sum(each.answer.value for each in scored), sum(each.gradient for each in scored)


@pytest.mark.parametrize("holes", [0.0, 0.15])
def test_frames_are_cut_and_taken_together(holes, monkeypatch):
    model, data = cycle(), PanelData(ALL, frames(1, runs=20, holes=holes))
    cut = Cut.of(model.network, data)
    assert sum(sum(fan.copies) for fan in cut.fans) == sum(map(len, cut.of_runs))
    if not holes:
        assert sum(map(len, cut.of_runs)) == data.looks  # every look tells the state
        assert sum(len(fan.runs) for fan in cut.fans) < data.looks / 2  # many are alike
    else:
        assert len(data.runs) < sum(map(len, cut.of_runs)) < data.looks
    point = {"k": 0.6, "q": 1.1, "bond": 0.07}
    together = PanelLikelihood(model, data).scored(point, NAMES)
    assert together.answer.kind == "proven"
    network = model.at(point).network
    assert together.answer.value == pytest.approx(by_expm(network, data, reached(model, [3, 1, 0, 1])), abs=1e-9)
    monkeypatch.setattr(Cut, "of", classmethod(lambda _, network, data: uncut(data)))
    value, gradient = one_by_one(model, data, point, NAMES)
    assert together.answer.low <= value <= together.answer.high
    np.testing.assert_allclose(together.gradient, gradient, rtol=1e-9, atol=1e-9)


def uncut(data):
    return Cut([fans.Fan([run], [1]) for run in data.runs], [[(r, 0)] for r in range(len(data.runs))])


def test_looks_after_other_times_are_not_alike():
    """The control: a fan of all looks from one state, whatever the time, would be wrong."""
    decay = Network.from_text("A -> B, 0.5")
    runs = [PanelRun([9, 0], [time], [[seen, 9 - seen]]) for time, seen in ((1.0, 6), (1.0, 5), (2.5, 4), (2.5, 2))]
    data = PanelData({"A": {"A": 1}, "B": {"B": 1}}, runs)
    law = sum(binom.logpmf(run.seen[0, 0], 9, np.exp(-0.5 * run.times[0])) for run in runs)
    assert [fan.copies for fan in Cut.of(decay, data).fans] == [[1, 1], [1, 1]]
    found = log_likelihood(decay, data)
    assert found.low <= law + 1e-13
    assert law - 1e-13 <= found.high
    assert found.error < 1e-11


@pytest.mark.parametrize(
    "observations",
    [
        {"C": Detected(0.8), "ab": Rounded(2.0)},
        {"C": Gaussian(0.6), "ab": Gaussian(1.5)},
        {"C": Censored({1.5: (1, 2)}), "ab": Detected(0.6)},
    ],
)
def test_snapshots_that_are_not_exact_are_taken_together(observations):
    rng, runs = np.random.default_rng(5), []
    for time in (0.4, 0.4, 0.4, 0.4, 1.7, 1.7, 1.7):
        seen = [[rng.choice([0.0, 1.0, 1.5 if isinstance(observations["C"], Censored) else 2.0]), rng.integers(2, 5)]]
        runs.append(PanelRun([3, 1, 0, 1], [time], np.where(rng.random((1, 2)) < 0.2, np.nan, seen)))
    data = PanelData({"C": {"C": 1}, "ab": {"A": 1, "B": 1, "D": 2}}, runs, observations)
    asked = PanelLikelihood(cycle(), data)
    assert any(len(fan.runs) > 1 for fan in Cut.of(cycle().network, data).fans)
    value = asked.value().value
    assert value == pytest.approx(by_expm(cycle().network, data, reached(cycle(), [3, 1, 0, 1])), abs=1e-10)
    point = {"k": 0.7, "q": 1.3, "bond": 0.05}
    point |= {name: each.parameter for name, each in data.observations.items() if each.parameter is not None}
    gradient = asked.scored(point, list(point)).gradient
    for p, name in enumerate(point):
        up, down = (asked.value({**point, name: point[name] * np.exp(sign * 1e-5)}).value for sign in (1, -1))
        assert gradient[p] == pytest.approx((up - down) / 2e-5, abs=2e-6)
    assert (gradient != 0).all()


def test_fans_over_the_same_states_share_them():
    model, data = cycle(), PanelData(ALL, frames(2, looks=60))
    known = {}
    steps = [FanStep.of(model.network, data, fan, known) for fan in Cut.of(model.network, data).fans]
    rows = {id(each.step.rows) for each in steps if each is not None}
    assert len(rows) == len(known) == 1
    assert sum(each is not None for each in steps) > 5


def test_states_before_each_look_are_told():
    model, data = cycle(), PanelData(ALL, frames(3, holes=0.1, runs=2))
    found = PanelLikelihood(model, data).filtered()
    for run, before in zip(data.runs, found, strict=True):
        assert len(before) == run.times.size
        assert before[0][0].tolist() == [[3, 1, 0, 1]]
        for look, (states, chances) in enumerate(before[1:]):
            assert chances.sum() == pytest.approx(1.0)
            known = ~np.isnan(run.seen[look])
            assert (states[:, known] == run.seen[look, known]).all()


def test_a_start_that_is_not_certain(monkeypatch):
    """Two states to start in: the likelihood is the mean of those from each, on every road."""
    model, (run, *_) = cycle(), frames(4, runs=1, looks=3, columns="C")
    states, chances = [[3, 1, 0, 1], [2, 2, 0, 1]], [0.3, 0.7]
    data = PanelData({"C": {"C": 1}}, [PanelRun(states, run.times, run.seen, chances=chances)] * 2)
    alone = [log_likelihood(model, PanelData(data.columns, [PanelRun(s, run.times, run.seen)])).value for s in states]
    mean = 2 * np.log(chances @ np.exp(alone))
    gradients = []
    for most in (1, 64):
        monkeypatch.setattr(few_states, "MOST_STATES", most)
        asked = PanelLikelihood(model, data)
        scored = asked.scored({}, NAMES)
        assert scored.answer.value == pytest.approx(mean, abs=1e-11)
        gradients.append(scored.gradient)
        assert sorted(asked.filtered()[0][0][1].tolist()) == chances
    np.testing.assert_allclose(*gradients, rtol=1e-9)
    assert mean != pytest.approx(2 * alone[0], abs=1e-3)


def test_an_interval_is_the_sum_of_its_counts():
    decay = Network.from_text("A -> B, 0.4")
    how = {"A": Censored({4.5: (3, 6), 7.1: (7, np.inf)})}

    def seen(*numbers):
        times = np.arange(1.0, len(numbers) + 1)
        return PanelData({"A": {"A": 1}}, [PanelRun([9, 0], times, np.array(numbers)[:, None])], how)

    law = binom(9, np.exp(-0.4))
    for number, low, high in ((4.5, 3, 6), (7.1, 7, 9), (2.0, 2, 2)):
        found = log_likelihood(decay, seen(number))
        assert found.value == pytest.approx(np.log(law.cdf(high) - law.cdf(low - 1)), abs=1e-12)
        assert found.kind == "proven"
    both = log_likelihood(decay, seen(7.1, 4.0)).value  # 4 at the end, from 7, 8 or 9
    law = sum(law.pmf(n) * binom.pmf(4, n, np.exp(-0.4)) for n in (7, 8, 9))
    assert both == pytest.approx(np.log(law), abs=1e-12)
    assert seen(4.5).digest != PanelData({"A": {"A": 1}}, seen(4.5).runs, {"A": Censored({4.5: (4, 5)})}).digest


def test_times_are_decimal_numbers():
    run = PanelRun([1, 0], [0.1, 0.2, 0.3, 0.7], np.full((4, 1), np.nan))
    assert run.lengths.tolist() == [0.1, 0.1, 0.1, 0.4]


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: PanelRun([[1, 0], [0, 1]], [1.0], [[1]], chances=[0.5, 0.4]), "2 states to start in, with chances"),
        (lambda: PanelRun([[1, 0], [0, 1]], [1.0], [[1]]), "expected one each"),
        (lambda: PanelRun([1, 0], [1.0], [[1]], chances=[-1.0]), "above 0"),
    ],
)
def test_wrong_starts_are_refused(made, said):
    with pytest.raises(ValueError, match=said):
        made()


def test_a_look_of_a_fan_that_cannot_be_is_named():
    decay = Model.of(Network.from_text("A -> B, 1"))
    for how, said in ((Censored({}), "line 4: A 4 cannot be reached from A 3"), (Detected(0.5), "line 4: A 4 cannot")):
        runs = [PanelRun([3, 0], [1.0], [[n]], where=[f"t.csv, line {n}"]) for n in (2, 4)]
        with pytest.raises(ValueError, match=said):
            PanelLikelihood(decay, PanelData({"A": {"A": 1}}, runs, {"A": how})).value()
