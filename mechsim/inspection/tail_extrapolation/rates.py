"""Rates of hits, and of breaks at any threshold, from the logs of runs: tail extrapolation (peaks over threshold).

A struck species X is hit by another body of species Y at a rate b_X s_Y^alpha x_X (x_Y - [X = Y]) / volume, with s_Y
the partner's size in cubes, and by walls at a rate a_X x_X surface / volume. Hits below the threshold are far more
frequent than breaks; the tail of their loads gives the rate at any threshold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinetics.runs import BY_WALL
from kinetics.support.intervals import exact_limits
from kinetics.support.packages import optimize
from mechsim.inspection.tail_extrapolation.loads import Loads
from mechsim.inspection.tail_extrapolation.tails import FEWEST, WIDTH, Tail, fit_tail

LEVELS = 3  # from the log's own up to half the way to the threshold, on a log scale
DOUBT = 2.576  # standard errors between answers from two levels that chance exceeds in 1 %


@dataclass(frozen=True)
class SizeExponent:
    """How hits by other bodies grow with the partner's size: alpha of size^alpha, with 95 % limits, at one level."""

    level: float
    hits: int
    alpha: float
    low: float
    high: float


def exponent(loads: Loads, level: float) -> SizeExponent | None:
    """Poisson regression of hits above a level on log size, with a factor of its own for every struck species.

    The factors are maximised in closed form, which leaves a concave likelihood of alpha; limits by its profile. None
    where all partners have one size, or there are no hits.
    """
    hits = loads.above(level)
    is_body = hits.partner != BY_WALL
    n_species = len(loads.species)
    seen = np.zeros((n_species, n_species))
    np.add.at(seen, (hits.struck[is_body], hits.partner[is_body]), 1)
    struck = [s for s in np.flatnonzero(seen.sum(axis=1)) if np.ptp(loads.sizes[loads.pairs[s] > 0]) > 0]
    if not struck:
        return None
    log_size = np.log(loads.sizes)
    seen, exposure = seen[struck], loads.pairs[struck]

    def fit(alpha: float) -> float:
        return float((seen @ log_size).sum() * alpha - seen.sum(axis=1) @ np.log(exposure @ np.exp(alpha * log_size)))

    best = optimize.minimize_scalar(
        lambda alpha: -fit(alpha), bounds=(-20.0, 20.0), method="bounded", options={"xatol": 1e-7}
    )

    def drop(alpha: float) -> float:
        return 2 * (-float(best.fun) - fit(alpha)) - WIDTH**2

    low, high = (
        float(optimize.brentq(drop, best.x, end)) if drop(end) > 0 else math.copysign(math.inf, end)
        for end in (-60.0, 60.0)
    )
    return SizeExponent(level, int(seen.sum()), float(best.x), low, high)


def exponent_doubts(found: Sequence[SizeExponent]) -> list[str]:
    """Where the exponent depends on the level: then heavy partners have another tail than light ones."""
    first, *others = found
    doubts = []
    for other in others:
        own, nested = ((e.high - e.low) / (2 * WIDTH) for e in (first, other))
        if _differ(other.alpha - first.alpha, own, nested):
            one, two = (f"{e.alpha:.2f} above {e.level:.3g}" for e in (first, other))
            doubts.append(f"the exponent is {one} and {two}")
    return doubts


def _differ(gap: float, error: float, error_above: float) -> bool:
    """Do answers from a level and from a higher one differ by more than chance?

    The hits above the higher level are among those above the lower one, so variances are subtracted (Hausman 1978,
    doi:10.2307/1913827); but errors are themselves estimates, so not below half the larger error.
    """
    spread = max(math.sqrt(max(error_above**2 - error**2, 0.0)), 0.5 * error_above)
    return not abs(gap) <= DOUBT * spread


@dataclass(frozen=True)
class HitRate:
    """Hits on one struck species above one level: rate of a body by anything, with exact 95 % limits, 1 / tu.

    wall_share : share of walls
    """

    species: str
    level: float
    hits: int
    rate: float
    low: float
    high: float
    wall_share: float


def hit_rates(loads: Loads, levels: Sequence[float]) -> list[HitRate]:
    """A table of rates by struck species and level."""
    rows = []
    for s in loads.can_break:
        for level in levels:
            mine = (loads.struck == s) & (loads.value > level)
            n, walls = int(mine.sum()), int((mine & (loads.partner == BY_WALL)).sum())
            low, high = (float(limit) for limit in exact_limits(n, loads.alone[s]))
            share = walls / n if n else math.nan
            rows.append(HitRate(loads.species[s], level, n, n / float(loads.alone[s]), low, high, share))
    return rows


@dataclass(frozen=True)
class BreakRate:
    """Rate at which one body of a species breaks by one source, per exposure, extrapolated from the tail of its loads.

    source : "bodies" (exposure: the other bodies, weighted by size^alpha, over the volume), "walls" (surface over
        volume) or "all" (time: the rate in the runs' own tanks)
    rate, low, high : with 95 % limits: of the number of hits and of the tail, combined on the log scale (Zou & Donner
        2008, doi:10.1002/sim.3095)
    tails : of each level; doubts : why the extrapolation is not trustworthy, if so
    """

    species: str
    source: str
    threshold: float
    exposure: float
    rate: float
    low: float
    high: float
    tails: tuple[Tail, ...]
    doubts: tuple[str, ...]

    @property
    def is_trustworthy(self) -> bool:
        """Do the answers from all levels agree?"""
        return not self.doubts


def levels_of(log_above: float, threshold: float) -> list[float]:
    """The levels from which a threshold is extrapolated: the log's own, and up to half the way on a log scale."""
    return [log_above * (threshold / log_above) ** (k / (2 * (LEVELS - 1))) for k in range(LEVELS)]


def break_rate(loads: Loads, species: int, source: str, threshold: float, alpha: float) -> BreakRate:
    """See `BreakRate`; alpha: of the partner's size. ValueError: too few hits, or a threshold below the log."""
    mine = loads.struck == species
    if source != "all":
        mine &= (loads.partner == BY_WALL) == (source == "walls")
    weights = loads.sizes.astype(float) ** alpha
    exposure = float({"all": loads.alone, "walls": loads.walls, "bodies": loads.pairs @ weights}[source][species])
    value = loads.value[mine]
    tails: list[Tail] = []
    doubts: list[str] = []
    answers = []
    for level in levels_of(loads.log_above, threshold):
        if tails and (value > level).sum() < FEWEST:
            doubts.append(f"only {(value > level).sum()} hits above {level:.3g}, too few to test whether it is stable")
            break
        tails.append(fit_tail(value, level, threshold))
        answers.append(_answer(tails[-1], exposure))
    (rate, low, high), *others = answers
    for tail, (other, least, most) in zip(tails[1:], others, strict=True):
        if _differ(math.log(other / rate), _log_error(low, high), _log_error(least, most)):
            doubts.append(f"from {tails[0].level:.3g} it is {rate:.3g}, from {tail.level:.3g} {other:.3g}")
    return BreakRate(loads.species[species], source, threshold, exposure, rate, low, high, tuple(tails), tuple(doubts))


def _answer(tail: Tail, exposure: float) -> tuple[float, float, float]:
    """Rate and limits: number of hits times probability."""
    rate = tail.number / exposure * tail.probability
    fewest, most = (float(limit) for limit in exact_limits(tail.number, 1.0))
    down = math.hypot(math.log(fewest / tail.number), _log(tail.low / tail.probability))
    up = math.hypot(math.log(most / tail.number), _log(tail.high / tail.probability))
    return rate, rate * math.exp(-down), rate * math.exp(up)


def _log(x: float) -> float:
    return math.log(x) if x > 0 else -math.inf


def _log_error(low: float, high: float) -> float:
    return (_log(high) - _log(low)) / (2 * WIDTH)


@dataclass(frozen=True)
class CountedBreaks:
    """Breaks counted in some runs beside those expected from the log of others; |z| is above 2 in some 8 % of cases."""

    species: str
    runs: int
    counted: int
    expected: float
    error: float
    z: float


def check(fitted: Loads, counted: Loads, runs: int) -> list[CountedBreaks]:
    """Breaks counted in `runs` runs, of species whose tail the logs of other runs can tell."""
    rows = []
    found = exponent(fitted, fitted.log_above)
    alpha = found.alpha if found else 0.0
    for s in counted.can_break:
        expected, variance = 0.0, 0.0
        weights = counted.sizes.astype(float) ** alpha
        exposures = {"bodies": float(counted.pairs[s] @ weights), "walls": float(counted.walls[s])}
        for source, exposure in exposures.items():
            if not exposure:
                continue  # a tank without walls, or a body alone in it
            try:
                rate = break_rate(fitted, s, source, fitted.threshold, alpha)
            except ValueError:  # too few hits by one source leave the breaks by all unknown
                break
            expected += rate.rate * exposure
            variance += (rate.rate * exposure * _log_error(rate.low, rate.high)) ** 2
        else:
            error = math.sqrt(variance)
            z = (float(counted.breaks[s]) - expected) / math.sqrt(expected + variance)
            rows.append(CountedBreaks(counted.species[s], runs, int(counted.breaks[s]), expected, error, z))
    return rows
