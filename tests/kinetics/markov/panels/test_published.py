"""The likelihood of panel data whose figures others have published."""

from pathlib import Path

import numpy as np
import pytest

from calibration import Events, fit_model
from kinetics import Model, Network
from kinetics.formats import read
from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun

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
    runs = [PanelRun(run.initial[:, np.argsort(place)], run.times, run.seen, run.start, run.fired) for run in runs]
    asked = PanelLikelihood(Model.of(network), PanelData(seen, runs, events=[("q14", "q24", "q34")]))
    found = asked.scored({}, network.channels)
    assert -2 * found.answer.value == pytest.approx(3968.79788, abs=1e-5)
    assert found.answer.is_bound
    assert found.answer.error < 1e-8
    assert np.abs(found.gradient).max() < 0.02


PREY = [50, 145, 265, 64, 35, 52, 201, 305, 26, 19, 90, 334, 61, 15, 24, 145]
PREDATORS = [100, 93, 248, 341, 166, 79, 54, 331, 364, 129, 50, 137, 508, 194, 65, 40]


def prey_and_predators(first, last):
    """Wilkinson's path (R package smfsb) between two of its 16 looks, two tu apart."""
    network = Network.from_text("birth: X -> 2 X, 1\neat: X + Y -> 2 Y, 0.005\ndeath: Y -> 0, 0.6")
    seen = np.column_stack([PREY, PREDATORS])[first : last + 1]
    run = PanelRun(seen[0], 2.0 * np.arange(1, len(seen)), seen[1:])
    return PanelLikelihood(Model.of(network), PanelData({"X": {"X": 1}, "Y": {"Y": 1}}, [run]))


@pytest.mark.parametrize(
    ("first", "last", "expected"),
    [
        (8, 9, -6.474464764626),
        pytest.param(0, 1, -8.9192055923, marks=pytest.mark.validate),
        pytest.param(0, 15, -124.48439479, marks=pytest.mark.validate),  # minutes
    ],
)
def test_prey_and_predators(first, last, expected):
    """Of an infinite network, likely states that move along; the first transition is known from outside."""
    found = prey_and_predators(first, last).value()
    assert found.value == pytest.approx(expected, abs=1e-9 * (last - first))
    assert found.kind == "proven"
    assert found.error < 5e-9 * (last - first)


def test_a_fit_of_prey_and_predators_takes_the_states_that_matter_to_both_looks():
    """Derivatives are those of the value with proven bounds, over a part of its states."""
    asked = prey_and_predators(8, 9)
    found = asked.scored({}, ["birth", "eat"])
    assert found.answer.kind == "estimate"
    assert found.answer.value == pytest.approx(-6.474464764626, abs=1e-9)
    for name, value, slope in zip(("birth", "eat"), (1.0, 0.005), found.gradient, strict=True):
        up, down = (asked.value({name: value * np.exp(step)}).value for step in (1e-4, -1e-4))
        assert slope == pytest.approx((up - down) / 2e-4, abs=1e-5)


@pytest.mark.skipif(not OUTSIDE.is_dir(), reason="data of others are not here")
@pytest.mark.parametrize(
    ("name", "rates"),
    [
        ("bos", [0.01559, 0.00439, 0.07329, 0.01047, 0.06444, 0.01983, 0.03205]),
        ("hagelloch", [0.00190681, 0.1259677]),
    ],
)
def test_events_of_others(name, rates):
    """R's msm and surveillance: events over exposure, by maximum likelihood of the parameters."""
    asked = Events().read(read(OUTSIDE / f"{name}.rxn"), OUTSIDE / f"{name}_events.csv")
    found = fit_model(asked, starts=1)
    given = [len(f"{rate:.7g}".lstrip("0.")) for rate in rates]
    assert [f"{value:.{digits}g}" for value, digits in zip(found.fit.value, given, strict=True)] == [
        f"{rate:.{digits}g}" for rate, digits in zip(rates, given, strict=True)
    ]
