"""The likelihood of panel data whose figures others have published."""

from pathlib import Path

import numpy as np
import pytest

from kinetics import Model, Network
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun, log_likelihood

OUTSIDE = Path(__file__).parents[5] / "shared" / "outside"
EYAM = [(0, 254, 7), (0.5, 235, 14), (1, 201, 22), (1.5, 153, 29), (2, 121, 20), (2.5, 110, 8), (3, 97, 8), (4, 83, 0)]


def test_eyam_1666():
    """The plague at Eyam (Raggett 1982): counts of susceptible and infective people at eight times."""
    model = Model.of(Network.from_text("infect: S + I -> 2 I, beta\nremove: I -> R, alpha", beta=0.02, alpha=3.0))
    times, seen = np.array(EYAM)[:, 0], np.array(EYAM)[:, 1:]
    run = PanelRun([254, 7, 0], times[1:], seen[1:])
    asked = PanelLikelihood(model, PanelData({"S": {"S": 1}, "I": {"I": 1}}, [run]))
    best = asked.scored({"alpha": 3.20384, "beta": 0.0196018}, ["alpha", "beta"])
    assert best.answer.value == pytest.approx(-40.517992, abs=1e-6)
    assert best.answer.is_bound
    assert best.answer.error < 2e-10
    assert np.abs(best.gradient).max() < 1e-3
    assert asked.value({"alpha": 3.39, "beta": 0.0212}).value == pytest.approx(-40.9585727718, abs=1e-9)


@pytest.mark.skipif(not OUTSIDE.is_dir(), reason="data of others are not here")
def test_recipients_of_hearts_seen_once_a_year():
    """R's msm, data set cav: four stages, the last of which is death, whose time is exact."""
    rows = np.genfromtxt(OUTSIDE / "cav_panel.csv", delimiter=",", skip_header=1)
    runs = []
    for person in np.unique(rows[:, 0]):
        years, stage = rows[rows[:, 0] == person, 1], rows[rows[:, 0] == person, 2].astype(int) - 1
        if years.size > 1:
            start, seen = np.eye(4, dtype=int)[stage[0]], np.eye(4)[stage[1:]]
            runs.append(PanelRun(start, years[1:], seen, years[0], fired=np.where(stage[1:] == 3, 0, -1)))
    rates = {"12": 0.12787, "14": 0.04249, "21": 0.2251, "23": 0.3426, "24": 0.04027, "32": 0.13062, "34": 0.30646}
    network = Network.from_text("\n".join(f"q{ij}: S{ij[0]} -> S{ij[1]}, {rate}" for ij, rate in rates.items()))
    seen = {f"S{i}": {f"S{i}": 1} for i in (1, 2, 3, 4)}
    place = [network.index(name) for name in seen]
    runs = [
        PanelRun(np.array(run.initial)[np.argsort(place)], run.times, run.seen, run.start, run.fired) for run in runs
    ]
    asked = PanelLikelihood(Model.of(network), PanelData(seen, runs, events=[("q14", "q24", "q34")]))
    found = asked.scored({}, network.channels)
    assert -2 * found.answer.value == pytest.approx(3968.79788, abs=1e-5)
    assert found.answer.is_bound
    assert found.answer.error < 1e-8
    assert np.abs(found.gradient).max() < 0.02


@pytest.mark.validate
def test_the_first_transition_of_prey_and_predators():
    """Wilkinson's path (R package smfsb): of an endless network, its likely states; seconds."""
    network = Network.from_text("birth: X -> 2 X, 1\neat: X + Y -> 2 Y, 0.005\ndeath: Y -> 0, 0.6")
    data = PanelData({"X": {"X": 1}, "Y": {"Y": 1}}, [PanelRun([50, 100], [2.0], [[145, 93]])])
    found = log_likelihood(network, data)
    assert found.value == pytest.approx(-8.9192055923, abs=1e-9)
    assert found.kind == "proven"
