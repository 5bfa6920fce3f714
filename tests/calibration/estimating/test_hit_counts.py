"""Exposures to hits and joins in a crowd, recomputed slowly, and fits that recover what made the hits."""

import numpy as np
import pytest
from hit_studies import ALPHA, FLAT, RADIUS, SURFACE, TALL, USUAL, VOLUME, changing_run, contact, hits
from numpy.testing import assert_allclose
from scipy.stats import binom

from calibration.estimating.hit_fit import HitFit
from calibration.estimating.hits import RunHits, Source
from kinetics.network import Crowding
from kinetics.rates.breaks import ShapeParameter
from kinetics.rates.crowding import THIRD
from kinetics.runs import BY_WALL

LAMBDA = ShapeParameter(THIRD, 0.0, 50.0, 0.1, is_weight=True)
NONE = np.array([], np.int64)


def runs_of(paths):
    return [
        RunHits(path, NONE, NONE, NONE.astype(float), NONE > 0, 0.004, 0.0065, str(path.tank), "own") for path in paths
    ]


def by_hand(source: Source, tank, third: float = 0.0) -> Crowding:
    """Contact values times 1 + third z, channel by channel."""
    network = source.expansion.network
    terms = np.zeros((len(network.channels), 5))
    for channel in range(len(network.channels)):
        who, copies = network.sparse_reactants.row(channel)
        pair = np.repeat(RADIUS[who], copies)
        r = pair.prod() / pair.sum() if pair.size == 2 else pair[0]
        terms[channel] = [0, 1, r + third, 2 / 9 * r**2 + third * r, third * 2 / 9 * r**2]
    return Crowding(SURFACE / tank.volume, VOLUME / tank.volume, terms)


def mass_action(source: Source):
    terms = np.ones((len(source.expansion.network.channels), 1))
    return source.exposure([Crowding(SURFACE, VOLUME / run.size.volume, terms) for run in source.runs])


def exposures(source: Source, third: float = 0.0):
    return source.exposure([by_hand(source, run.size, third) for run in source.runs])


@pytest.mark.parametrize("name", ["bodies", "walls", "joins"])
def test_exposures_are_integrals_over_the_path(name):
    """In three tanks of one composition that changes, by a loop over the stretches."""
    runs = runs_of([changing_run(tank, seed) for seed, tank in enumerate((USUAL, TALL, FLAT))])
    source = Source.of(name, runs)
    found, plain = exposures(source), mass_action(source)
    slow, slower = np.zeros(found.shape), np.zeros(found.shape)
    for n, run in enumerate(runs):
        edges = [0.0, *run.path.times, run.path.end]
        for counts, begin, end in zip(run.path.states, edges, edges[1:], strict=False):
            for g, rate in enumerate(source.rates):
                for p in range(source.channels.shape[1]):
                    if name == "joins":
                        x, y = (int(part) - 1 for part in rate.split("->")[0].split("+"))
                        pairs = counts[x] * (counts[y] - (x == y)) / (2 if x == y else 1) / run.size.volume
                    elif name == "bodies":
                        x, y = g + 1, p
                        pairs = counts[x] * (counts[y] - (x == y)) / run.size.volume
                    else:
                        x, y, pairs = g + 1, None, counts[g + 1] * run.size.surface / run.size.volume
                    radius = RADIUS[x] if y is None else RADIUS[x] * RADIUS[y] / (RADIUS[x] + RADIUS[y])
                    slow[n, g, p] += (end - begin) * pairs * contact(radius, counts, run.size)
                    slower[n, g, p] += (end - begin) * pairs
    assert_allclose(found, slow, rtol=1e-12)
    assert_allclose(plain, slower, rtol=1e-12)
    assert (found > 1.02 * plain).all()  # control: the crowd is felt


def test_hits_are_counted_by_source_and_load():
    path = changing_run(USUAL)
    run = RunHits(
        path, np.array([1, 1, 3, 3, 2]), np.array([0, BY_WALL, 3, 3, BY_WALL]), np.array([5.0, 6, 7, 8, 9]),
        np.array([False, True, True, False, False]), 4.0, 6.5, "usual", "own",
    )  # fmt: skip
    bodies, walls = Source.of("bodies", [run]).events(), Source.of("walls", [run]).events(5.0, 8.5)
    assert bodies.sum() == 3
    assert bodies[0, 0, 0, 0] == bodies[0, 2, 3, 0] == bodies[0, 2, 3, 1] == 1
    assert walls.sum() == walls[0, 0, 0, 1] == 1
    joins = Source.of("joins", [run])
    fired = np.bincount(path.channels, minlength=8)
    assert joins.events()[0, :, 0, 0].tolist() == fired[:4].tolist()
    assert fired[:4].all()


def fit_of(runs, name, held=None):
    source = Source.of(name, runs)
    pairs, triples = exposures(source), exposures(source, 1.0)
    around = source.around([by_hand(source, run.size) for run in runs])
    return HitFit.of(source, source.events(), around, lambda third: pairs + third * (triples - pairs), LAMBDA, held)


THREE, REACH, BEYOND = 0.5, 0.06, 0.3
TRUTH = THREE / (1 + THREE * BEYOND)


@pytest.mark.parametrize("name", ["bodies", "walls"])
def test_counts_and_shares_tell_hits_of_three_from_coincidence(name):
    """All values at once, from one long log; 4.9 standard errors."""
    fit = fit_of(hits(np.random.default_rng(1), 4000.0, THREE, REACH, BEYOND), name)
    assert abs(fit.theta - TRUTH) < 0.06
    assert abs(fit.values["reach"] - REACH) < 0.04
    assert abs(fit.values["beyond"] - BEYOND) < 0.04
    if name == "bodies":
        assert abs(fit.values["alpha"] - ALPHA) < 0.02
    plain = fit_of(hits(np.random.default_rng(2), 4000.0, 0.0, REACH, BEYOND), name)
    assert plain.theta < 0.06  # control: coincidence alone
    assert abs(plain.values["reach"] - REACH) < 0.04


@pytest.mark.parametrize("name", ["bodies", "walls"])
def test_limits_cover_hits_of_three(name):
    """95 % limits in 60 short logs, given how often a third body touches by coincidence; false alarm below 1e-6."""
    held = {"reach": REACH, "beyond": BEYOND}
    fits = [fit_of(hits(np.random.default_rng(seed), 40.0, THREE, REACH, BEYOND), name, held) for seed in range(60)]
    inside = [low <= TRUTH <= high for low, high in (fit.interval for fit in fits)]
    assert sum(inside) >= binom(60, 0.95).ppf(1e-6)
    values = np.array([fit.theta for fit in fits])
    assert abs(values.mean() - TRUTH) < 4.9 * values.std() / np.sqrt(60) + 0.02
    assert not any(low <= 0 for low, _ in (fit.interval for fit in fits))  # control: two bodies do not make these hits


def test_the_scatter_between_runs_widens_limits():
    """Runs whose rates differ by a tenth: the scatter tells, and is 1 for Poisson counts."""
    rng = np.random.default_rng(3)
    steady = fit_of([run for _ in range(5) for run in hits(rng, 400.0)], "walls")
    uneven = fit_of([run for _ in range(5) for run in hits(rng, 400.0, scatter=0.3)], "walls")
    assert steady.own_scatter < 1.6
    assert uneven.own_scatter > 3
