"""the extrapolation for rare breaks, on hits of known rates, exponents and tails."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kinetics.runs import BY_WALL
from mechsim.inspection.tail_extrapolation.loads import Loads
from mechsim.inspection.tail_extrapolation.rates import (
    break_rate,
    check,
    exponent,
    exponent_doubts,
    hit_rates,
    levels_of,
)
from mechsim.inspection.tail_extrapolation.tails import fit_tail

NAMES, SIZES = ("monomer", "dimer", "trimer", "quadmer"), np.array([1, 2, 3, 4])
LOG, THRESHOLD = 1.0, 2.0
QUADMER = 3


def pareto(rng, n, shape, scale):
    z = rng.exponential(size=n)
    return scale * (np.expm1(shape * z) / shape if shape else z)


def survival(y, shape, scale):
    return (1 + shape * y / scale) ** (-1 / shape) if shape else math.exp(-y / scale)


def hits(rng, alpha=1.3, shape=0.1, scale=0.25, bodies=4e-3, walls=8e-3, tu=2000.0, draw=None, breaks=1.0):
    """Logs of some runs: every species hit by all others at a rate bodies * size^alpha, and by walls."""
    counts = np.array([20.0, 10.0, 8.0, 12.0])
    alone, pairs = counts * tu, (np.outer(counts, counts) - np.diag(counts)) / 12.0 * tu
    exposure_to_walls = alone * 2.7
    struck, partner = [], []
    for s in (1, 2, 3):
        for other, exposure, rate in [
            *((y, pairs[s, y], bodies * SIZES[y] ** alpha) for y in range(4)),
            (BY_WALL, exposure_to_walls[s], walls),
        ]:
            n = rng.poisson(rate * exposure)
            struck += [s] * n
            partner += [other] * n
    struck, partner = np.array(struck), np.array(partner)
    value = LOG + (pareto(rng, len(struck), shape, scale) if draw is None else draw(rng, partner))
    broken = np.bincount(struck[value > THRESHOLD], minlength=4)
    broken = rng.poisson(breaks * broken) if breaks != 1 else broken
    return Loads(
        NAMES, SIZES, struck, partner, value, alone, pairs, exposure_to_walls, broken, LOG, THRESHOLD
    )  # fmt: skip


@pytest.mark.parametrize("shape", [-0.1, 0.0, 0.25])
def test_the_tail_covers_the_truth(shape):
    rng = np.random.default_rng(11)
    truth = survival(3.0, shape, 1.0)
    fits = [fit_tail(1 + pareto(rng, 150, shape, 1.0), 1.0, 4.0) for _ in range(200)]
    covered = sum(fit.low <= truth <= fit.high for fit in fits)
    assert 178 <= covered <= 200  # 95 % of 200, four standard errors
    assert np.median([fit.probability for fit in fits]) == pytest.approx(truth, rel=0.25)
    np.testing.assert_allclose(fits[0].beyond(np.array([1.0, 4.0])), [1.0, fits[0].probability], rtol=1e-5)


def test_an_exponential_for_a_heavy_tail_misses():
    """The control: 10,000 loads with shape .25 and the answer of a law without a shape."""
    loads = 1 + pareto(np.random.default_rng(3), 10_000, 0.25, 1.0)
    truth = survival(8.0, 0.25, 1.0)
    fit = fit_tail(loads, 1.0, 9.0)
    assert fit.low < truth < fit.high
    assert math.exp(-8.0 / (loads - 1).mean()) < fit.low / 4
    light = fit_tail(1 + pareto(np.random.default_rng(3), 10_000, 0.0, 1.0), 1.0, 9.0)
    assert light.high < fit.low


def test_the_exponent_covers_the_truth():
    rng = np.random.default_rng(5)
    found = [exponent(hits(rng, alpha=1.3), LOG) for _ in range(100)]
    assert sum(e.low <= 1.3 <= e.high for e in found) >= 87
    assert sum(e.low <= 0.0 <= e.high for e in found) == 0
    assert np.mean([e.alpha for e in found]) == pytest.approx(1.3, abs=0.05)


def test_an_exponent_that_depends_on_the_level_is_doubted():
    def heavier(rng, partner):
        size = np.where(partner == BY_WALL, 1, partner + 1)
        return pareto(rng, len(partner), 0.0, 0.15 * size)

    rng = np.random.default_rng(6)
    levels = levels_of(LOG, THRESHOLD)
    alarms = {
        name: sum(bool(exponent_doubts([exponent(h, v) for v in levels])) for h in made)
        for name, made in {
            "one tail": [hits(rng) for _ in range(40)],
            "by partner": [hits(rng, draw=heavier) for _ in range(10)],
        }.items()
    }
    assert alarms["one tail"] <= 4
    assert alarms["by partner"] == 10


def test_the_break_rate_covers_the_truth_and_is_trusted():
    rng = np.random.default_rng(8)
    for source, rate_of_hits in {"bodies": 4e-3, "walls": 8e-3}.items():
        found = [break_rate(hits(rng), QUADMER, source, 3.0, 1.3) for _ in range(60)]
        rate = rate_of_hits * survival(2.0, 0.1, 0.25)
        assert sum(f.low <= rate <= f.high for f in found) >= 51
        assert sum(not f.is_trustworthy for f in found) <= 5


def test_a_tail_of_two_kinds_of_hit_is_not_trusted():
    """Many weak hits and a few of another kind, which the level of the log hardly sees."""

    def mixed(rng, partner):
        n = len(partner)
        return np.where(rng.random(n) < 0.97, rng.exponential(0.08, n), rng.exponential(1.0, n))

    rng = np.random.default_rng(9)
    found = [break_rate(hits(rng, draw=mixed, tu=2000.0), QUADMER, "all", 3.0, 1.3) for _ in range(10)]
    assert sum(not f.is_trustworthy for f in found) >= 9


def test_breaks_counted_elsewhere_agree_with_the_gauge_and_others_do_not():
    rng = np.random.default_rng(10)
    wide = {"scale": 0.4, "tu": 200.0}
    rows = [row for _ in range(40) for row in check(hits(rng, **wide), hits(rng, **wide | {"tu": 800.0}), 4)]
    assert len(rows) >= 115
    assert np.mean([abs(row.z) > 2 for row in rows]) < 0.13
    doubled = check(hits(rng, **wide), hits(rng, **wide | {"tu": 800.0, "breaks": 2.0}), 4)
    assert all(row.z > 2 for row in doubled)


def test_tanks_without_walls_are_checked_too():
    """No exposure to walls is no lack of hits by them; hits by walls that are too few to tell are."""
    rng = np.random.default_rng(13)
    fitted, counted = (replace(hits(rng, scale=0.4, tu=800.0, walls=0.0), walls=np.zeros(4)) for _ in range(2))
    assert [row.species for row in check(fitted, counted, 1)] == ["dimer", "trimer", "quadmer"]
    assert not check(fitted, hits(rng, scale=0.4), 1)


def test_rates_of_hits_are_counts_over_time():
    loads = hits(np.random.default_rng(12))
    rows = {(row.species, row.level): row for row in hit_rates(loads, [LOG, 1.5])}
    assert {species for species, _ in rows} == {"dimer", "trimer", "quadmer"}
    row = rows["quadmer", 1.5]
    mine = (loads.struck == QUADMER) & (loads.value > 1.5)
    assert row.hits == mine.sum()
    assert row.rate == pytest.approx(mine.sum() / (12 * 2000))
    assert row.low < row.rate < row.high
    assert row.wall_share == pytest.approx((loads.partner[mine] == BY_WALL).mean())


@pytest.mark.parametrize(
    ("loads", "threshold", "message"), [(np.full(5, 2.0), 3.0, "5 loads above 1"), (np.full(50, 2.0), 0.5, "not above")]
)
def test_a_tail_of_few_loads_is_refused(loads, threshold, message):
    with pytest.raises(ValueError, match=message):
        fit_tail(loads, 1.0, threshold)


def test_too_few_hits_above_the_higher_levels_are_said():
    loads = hits(np.random.default_rng(1), tu=60.0, scale=0.1)
    found = break_rate(loads, QUADMER, "all", 3.0, 1.3)
    assert not found.is_trustworthy
    assert "too few to test whether it is stable" in found.doubts[0]
