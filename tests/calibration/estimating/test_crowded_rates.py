"""Rates in a crowd: exposures with its factors along the path, recomputed slowly, and estimates of known rates."""

from dataclasses import replace

import numpy as np
import pytest
from hit_studies import RADIUS, SURFACE, TALL, USUAL, VOLUME, changing_run, hits
from numpy.testing import assert_allclose
from synthetic_runs import line_network

from calibration import estimate
from calibration.estimating.break_fit import fit_breaks
from calibration.estimating.study import CalibrationStudy
from kinetics.rates import CrowdingTerms
from kinetics.rates.breaks import Expansion, break_model, is_break
from kinetics.rates.crowding import ConvexBodies
from kinetics.rates.crowding_terms import BodyGeometry
from kinetics.runs import JumpPath

LINE = line_network()
WALLS = break_model("collision-wall")
GEOMETRY = {
    name: BodyGeometry(radius=float(r), surface=float(s), volume=float(v))
    for name, r, s, v in zip(LINE.species, RADIUS, SURFACE, VOLUME, strict=True)
}
TERMS = CrowdingTerms(
    bodies="hard-bodies", walls="three-body", joins="linear", species=GEOMETRY,
    shape={"walls": {"third": 0.6}, "joins": {"c": 0.4}},
)  # fmt: skip
SHAPE = {"alpha": 1.3, "wall": 40.0}


def crowded_network(tank):
    """The line of four whose breaks have partners, in a tank, with the factors of the crowd."""
    found = Expansion.of(LINE, WALLS)
    coefficients = np.where(is_break(LINE), 3e-4, 2e-4)
    constants = found.constants(coefficients, WALLS.weights(LINE, SHAPE)) * found.scales(USUAL, tank)
    return found, replace(found.network.with_rates(constants), laws=TERMS.crowding(found, tank).laws(found.network))


def sampled(tank, seed, end=40.0):
    """A run by the direct method in plain Python, seen on the network with one channel a break."""
    rng = np.random.default_rng(seed)
    found, network = crowded_network(tank)
    state, time = np.array([30, 12, 10, 12]) * round(tank.volume / 12), 0.0
    initial, times, channels = state.copy(), [], []
    while True:
        rates = network.propensities(state)
        time += rng.exponential(1 / rates.sum())
        if time > end:
            return JumpPath(LINE, initial, times, channels, end, tank=tank)
        fired = rng.choice(rates.size, p=rates / rates.sum())
        state = state + network.stoichiometry[fired]
        times.append(time)
        channels.append(int(found.base_of[fired]))


@pytest.fixture(scope="module")
def runs():
    return [sampled(tank, seed) for seed in range(5) for tank in (USUAL, TALL)]


def test_exposures_count_the_crowd_along_the_path():
    """Of joins and of breaks, in two tanks, by a loop over the stretches of propensities of the crowded network."""
    paths = [changing_run(tank, seed) for seed, tank in enumerate((USUAL, TALL))]
    joins = estimate(paths, TERMS.crowding).total.exposure
    fit = fit_breaks(WALLS, paths, fixed=SHAPE, crowd=TERMS.crowding)
    breaks = np.array([e.exposure[0] for e in fit.likelihood.evidence(fit.model)])
    slow = np.zeros(len(LINE.channels))
    for path in paths:
        found, network = crowded_network(path.tank)
        edges = [0.0, *path.times, path.end]
        for state, begin, end in zip(path.states, edges, edges[1:], strict=False):
            each = (end - begin) * network.propensities(state)
            slow += np.bincount(found.base_of, each, len(LINE.channels)) / np.where(is_break(LINE), 3e-4, 2e-4)
    assert_allclose(joins[~is_break(LINE)], slow[~is_break(LINE)], rtol=1e-12)
    assert_allclose(breaks, slow[is_break(LINE)], rtol=1e-12)
    plain = estimate(paths).total.exposure
    assert (joins[~is_break(LINE)] > 1.02 * plain[~is_break(LINE)]).all()  # control


def test_estimates_recover_the_rates_of_a_crowded_network(runs):
    """4.9 standard errors of all joins and all breaks pooled; mass action, the control, is off."""
    fired = np.concatenate([run.channels for run in runs])
    for is_kind, truth in ((~is_break(LINE), 2e-4), (is_break(LINE), 3e-4)):
        n = is_kind[fired].sum()
        assert n > 1000
        for crowd, holds in ((TERMS.crowding, True), (None, False)):
            if truth == 2e-4:
                exposure = estimate(runs, crowd).total.exposure[is_kind].sum()
            else:
                fit = fit_breaks(WALLS, runs, fixed=SHAPE, crowd=crowd)
                exposure = sum(e.exposure[0] for e in fit.likelihood.evidence(fit.model))
            assert (abs(n / exposure / truth - 1) < 4.9 / np.sqrt(n)) == holds, (truth, n / exposure)


def study(paths, **settings):
    return CalibrationStudy("line4", paths, {}, "", "", breaks="collision-wall", **settings)


def test_a_study_measures_rates_under_the_crowding_it_writes():
    logged = [run for seed in range(2) for run in hits(np.random.default_rng(seed), 400.0, third=0.5)]
    paths = [changing_run(tank, seed) for seed, tank in enumerate((USUAL, TALL))]
    bodies = ConvexBodies(RADIUS, SURFACE, VOLUME)
    found = study(paths, crowding="auto", hits=logged, bodies=bodies)
    terms = found.rates.crowding
    assert terms.walls == "three-body"
    assert abs(terms.shape["walls"]["third"] - 0.5 / 1.15) < 0.1
    assert set(terms.species) == set(LINE.species)
    assert "three-body (third = " in found.rates.evidence["crowding"]
    assert found.to_dict()["crowding"]["chosen"]["walls"] == "three-body"
    plain = study(paths, crowding="none", hits=logged, bodies=bodies)
    assert plain.rates.crowding is None
    assert plain.to_dict()["crowding"] is None
    hard = study(paths, crowding="hard-bodies", bodies=bodies)
    assert (hard.rates.crowding.bodies, hard.rates.crowding.joins) == ("hard-bodies", "none")
    assert hard.rates.channels["2->1+1"].exposure > 1.02 * plain.rates.channels["2->1+1"].exposure


def test_without_logged_hits():
    paths = [changing_run(USUAL)]
    bodies = ConvexBodies(RADIUS, SURFACE, VOLUME)
    assert study(paths, crowding="auto", bodies=bodies).rates.crowding is None
    with pytest.raises(ValueError, match="no run has a log of them"):
        study(paths, crowding="three-body", bodies=bodies).rates.crowding  # noqa: B018
    with pytest.raises(ValueError, match="needs the geometry of bodies"):
        study(paths, crowding="hard-bodies").rates.crowding  # noqa: B018
    with pytest.raises(ValueError, match="a run without its tank; crowding depends on the volume"):
        study([replace(paths[0], tank=None)], crowding="hard-bodies", bodies=bodies).rates.crowding  # noqa: B018
