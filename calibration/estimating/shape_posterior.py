"""The posterior of the shape parameters of a break model, the coefficients integrated out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np

from calibration.estimating.break_rates import BreakRates
from calibration.estimating.rate_fit import RateFit
from kinetics.rates import ShapePosterior
from kinetics.rates.breaks import ShapeParameter
from kinetics.support.arrays import Floats

LogDensity = Callable[[Floats], Floats]  # points (G, K) -> (G,)

COARSE = {1: 129, 2: 41}  # a side of the grid that finds where the posterior lies, by the number of shape parameters
FINE = {1: 129, 2: 65}  # and of the one that lies there
POINTS = 256  # of the same probability, to which the fine grid is thinned
REST = 1e-5  # of the largest share of the posterior: points below it are left out
WALKERS, MOVES = 200, 150  # for more parameters than a grid can hold
SEED = 0


def shape_posterior(fit: RateFit) -> ShapePosterior | None:
    """The posterior in points with probabilities; None if the fitted break model has no shape that was not held.

    Each coefficient b has Jeffreys' prior of a Poisson mean, the number of breaks b E(shape) that the runs should have,
    so that its integral over n breaks is proportional to E^-n: the marginal likelihood of the shape is its profile
    likelihood, and does not depend on the partner whose weight is called 1. The priors of the shape parameters are
    those of `ShapeParameter.value`. Parameters that were held stay where they are.

    One and two parameters are on a grid, narrowed to where the posterior lies. More are sampled by walkers that stretch
    towards each other (Goodman & Weare 2010, doi:10.2140/camcos.2010.5.65), with a fixed seed: means to 7 % of the
    standard deviation.

    Cost: some 10,000 likelihoods for a grid, 30,000 for walkers; a second for 1,000 breaks.
    """
    model, mixed = fit.model, fit.likelihood.mixed(fit.best.events)
    if not isinstance(model, BreakRates) or mixed is None:
        return None
    free = [parameter for parameter in model.shape if parameter.name not in fit.fixed]

    def log_density(shapes: list[dict[str, float]]) -> Floats:
        return mixed.mle(np.concatenate([model.with_shape(shape).mixture() for shape in shapes]))

    return posterior_of(free, model.shape_values, log_density)


def posterior_of(
    free: Sequence[ShapeParameter], best: Mapping[str, float], log_density: Callable[[list[dict[str, float]]], Floats]
) -> ShapePosterior | None:
    """The posterior of the free shape parameters, the others as in `best`; None if all are held.

    best : all shape parameters at the largest likelihood
    log_density : profile log-likelihood (G,) at each of some shapes
    """
    if not free:
        return None

    def shapes(units: Floats) -> list[dict[str, float]]:
        values = np.array([p.value(u) for p, u in zip(free, units.T, strict=True)]).T
        return [dict(zip((p.name for p in free), row, strict=True)) for row in values.tolist()]

    def density(units: Floats) -> Floats:
        return log_density(shapes(units))

    at_best = np.array([p.unit(best[p.name]) for p in free])
    units, weights = _narrowed(density, len(free)) if len(free) in FINE else _walked(density, at_best)
    table = [[float(f"{value:.6g}") for value in (dict(best) | shape).values()] for shape in shapes(units)]
    return ShapePosterior(points=tuple(map(tuple, table)), weights=tuple(weights.tolist()))


def _narrowed(log_density: LogDensity, k: int) -> tuple[Floats, Floats]:
    """Points (G, K) of a grid over the posterior, and the probability (G,) of each."""
    low, high = np.zeros(k), np.ones(k)
    for _ in range(3):
        points, weights = _grid(log_density, low, high, COARSE[k])
        low, high = _where(points, weights, low, high, COARSE[k])
    points, weights = _grid(log_density, low, high, FINE[k])
    # Thinned evenly along the grid, row after row, so that a file has hundreds of points and not thousands.
    places = np.searchsorted(np.cumsum(weights), (np.arange(POINTS) + 0.5) / POINTS * weights.sum())
    kept, copies = np.unique(np.minimum(places, weights.size - 1), return_counts=True)
    return points[kept], copies / POINTS


def _grid(log_density: LogDensity, low: Floats, high: Floats, side: int) -> tuple[Floats, Floats]:
    """Cell centres (G, K) of a grid from low to high, and the share of the posterior (G,) of each."""
    axes = [a + (b - a) * (np.arange(side) + 0.5) / side for a, b in zip(low, high, strict=True)]
    points = np.array(list(product(*axes)))
    logs = log_density(points)
    weights = np.exp(logs - logs.max())
    return points, weights / weights.sum()


def _where(points: Floats, weights: Floats, low: Floats, high: Floats, side: int) -> tuple[Floats, Floats]:
    """The box around all that the posterior holds, one cell wider."""
    kept = points[weights > REST * weights.max()]
    cell = (high - low) / side
    return np.maximum(kept.min(axis=0) - 1.5 * cell, low), np.minimum(kept.max(axis=0) + 1.5 * cell, high)


def _walked(log_density: LogDensity, start: Floats) -> tuple[Floats, Floats]:
    """Points (G, K) drawn from the posterior, all of the same probability (G,).

    Half of the walkers move at a time, each along the line to one of the other half.
    """
    rng = np.random.default_rng(SEED)
    k = start.size
    spread = rng.uniform(size=(WALKERS, k))
    units = start + 0.1 * (spread - start)  # between the best point and anywhere: inside the range
    logs = log_density(units)
    half = WALKERS // 2
    for move in range(2 * MOVES):
        movers, others = (slice(half), slice(half, None)) if move % 2 else (slice(half, None), slice(half))
        stretch = (1 + rng.uniform(size=half)) ** 2 / 2  # density 1 / sqrt(z) between 1/2 and 2
        partners = units[others][rng.integers(half, size=half)]
        moved = partners + stretch[:, None] * (units[movers] - partners)
        inside = ((moved >= 0) & (moved <= 1)).all(axis=1)
        found = np.full(half, -np.inf)
        found[inside] = log_density(moved[inside])
        accepted = np.log(rng.uniform(size=half)) < (k - 1) * np.log(stretch) + found - logs[movers]
        units[movers][accepted], logs[movers][accepted] = moved[accepted], found[accepted]
    return units, np.full(WALKERS, 1 / WALKERS)
