"""Cases of the stochastic part of the SBML Test Suite, where a folder with them is given: --dsmts FOLDER.

The suite is Evans, Gillespie & Wilkinson (2008); its files are not part of this repository. A case is a folder with its
model in all levels of SBML, `*-settings.txt` and `*-results.csv`. Its criteria at n runs, for every species and time:
-3 < Z < 3 with Z = sqrt(n) (m - mu) / sigma, and -5 < Y < 5 with Y = sqrt(n / 2) (s²/sigma² - 1).
"""

import csv
import logging
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from kinetics import Auto, simulate
from kinetics.formats import read

LOG = logging.getLogger(__name__)  # shown by --log-cli-level=INFO
RUNS = 10_000
SEEDS = (1, 2, 3)  # a point is wrong where it is outside under all of them: by chance in 2e-8 of the points
Z_LIMIT, Y_LIMIT = 3.0, 5.0


class Case(NamedTuple):
    """What a case expects: means and standard deviations (T, V) of its variables."""

    files: list[Path]
    variables: list[str]
    times: np.ndarray
    mean: np.ndarray
    sd: np.ndarray


def load(folder):
    (results,) = folder.glob("*-results.csv")
    with results.open(encoding="utf-8") as file:
        rows = [{key.strip(): float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    variables = [name.removesuffix("-mean") for name in rows[0] if name.endswith("-mean")]
    columns = {
        kind: np.array([[row[f"{name}-{kind}"] for name in variables] for row in rows]) for kind in ("mean", "sd")
    }
    return Case(sorted(folder.glob("*-sbml-*.xml")), variables, np.array([row["time"] for row in rows]), **columns)


def pytest_generate_tests(metafunc):
    if "folder" in metafunc.fixturenames:
        given = metafunc.config.getoption("--dsmts")
        folders = sorted(path for path in Path(given).iterdir() if path.is_dir()) if given else []
        if given and not folders:
            raise pytest.UsageError(f"--dsmts {given}: no case in this folder")
        if not folders:
            folders = [pytest.param(None, marks=pytest.mark.skip(reason="no folder of cases; see --dsmts"))]
        metafunc.parametrize("folder", folders, ids=lambda path: path.name if path else "none")


def observed(model, variables):
    """Weights (S, V) of the variables: species, or what the file's rules add up."""
    weights = [model.observables.get(name, {name: 1.0}) for name in variables]
    return np.array([[each.get(species, 0.0) for each in weights] for species in model.network.species])


def scores(case, model, seed, rate=1.0):
    """Z and Y (T, V), 0 where nothing varies and nothing differs."""
    network = model.network.with_rates(rate * model.network.known_rates)
    counts = simulate(network, Auto(), model.initial, case.times, RUNS, seed).counts @ observed(model, case.variables)
    mean, variance = counts.mean(axis=0), counts.var(axis=0, ddof=1)
    is_certain = case.sd == 0
    assert np.array_equal(mean[is_certain], case.mean[is_certain])
    sigma = np.where(is_certain, 1.0, case.sd)
    z = np.where(is_certain, 0.0, math.sqrt(RUNS) * (mean - case.mean) / sigma)
    y = np.where(is_certain, 0.0, math.sqrt(RUNS / 2) * (variance / sigma**2 - 1))
    return z, y


def is_outside(z, y):
    return (np.abs(z) >= Z_LIMIT) | (np.abs(y) >= Y_LIMIT)


def test_case(folder):
    case = load(folder)
    model = read(case.files[-1])
    outside = np.ones(case.mean.shape, dtype=bool)
    for seed in SEEDS:
        z, y = scores(case, model, seed)
        LOG.info("%s, seed %d: largest |Z| %.2f, |Y| %.2f", folder.name, seed, np.abs(z).max(), np.abs(y).max())
        outside &= is_outside(z, y)
        if not outside.any():
            return
    times, variables = np.nonzero(outside)
    pytest.fail(f"{case.variables[variables[0]]} at {case.times[times[0]]:g} and {times.size - 1} more points")


def test_a_wrong_rate_is_seen(folder):
    """A control that must fail: all rates 3 % too large."""
    case = load(folder)
    assert is_outside(*scores(case, read(case.files[-1]), SEEDS[0], rate=1.03)).any()


def test_every_level_says_the_same(folder):
    case = load(folder)
    models = [read(file) for file in case.files]
    assert len(models) >= 7
    for model in models[1:]:
        assert model.network.fingerprint == models[0].network.fingerprint
        assert np.array_equal(model.network.known_rates, models[0].network.known_rates)
        assert np.array_equal(model.initial, models[0].initial)
