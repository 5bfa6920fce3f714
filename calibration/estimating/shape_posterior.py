"""The posterior of the shape parameters of a break model, the coefficients integrated out."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from calibration.estimating.break_rates import BreakRates
from calibration.estimating.likelihood import Evidence
from calibration.estimating.rate_fit import RateFit
from kinetics.breaks import ShapeParameter
from kinetics.rates import ShapePosterior
from kinetics.support.arrays import Floats

POINTS = {1: 33, 2: 13, 3: 7}  # a side of the grid, by the number of shape parameters
COARSE = {1: 129, 2: 41, 3: 17}  # of the grid that finds where the posterior lies
REST = 1e-5  # of the largest share of the posterior: points below it are left out


def shape_posterior(fit: RateFit) -> ShapePosterior | None:
    """The posterior on a grid, or None where the fitted break model has no shape that was not held.

    Each coefficient has Jeffreys' prior given the shape, so that its integral over n events and exposure E(shape) is
    proportional to E^-(n + 1/2). A shape parameter of bounded range is uniform on it beforehand; a weight has the
    density s / (s + w)^2 with its start s as the median. Parameters that were held stay where they are.

    Cost: some thousand evaluations of a likelihood, under a second.
    """
    model = fit.model
    if not isinstance(model, BreakRates) or not model.shape:
        return None
    free = [parameter for parameter in model.shape if parameter.name not in fit.fixed]
    if not free:
        return None
    sides = POINTS.get(len(free), 5)
    parts = fit.likelihood.parts(model)

    def log_density(unit: Floats) -> float:
        shape = {p.name: _value(p, u) for p, u in zip(free, unit.tolist(), strict=True)}
        return _log_marginal(parts, model.with_shape(shape).mixture()[0])

    low, high = np.zeros(len(free)), np.ones(len(free))
    for _ in range(3):  # narrowed until the grid lies where the posterior does
        points, weights = _grid(log_density, low, high, COARSE.get(len(free), 7))
        low, high = _where(points, weights, low, high)
    points, weights = _grid(log_density, low, high, sides)
    kept = weights > REST * weights.max()
    values = [[_value(p, u) for p, u in zip(free, point, strict=True)] for point in points[kept].tolist()]
    by_name = [dict(zip((p.name for p in free), row, strict=True)) for row in values]
    table = [[float(f"{row.get(name, best):.6g}") for name, best in model.shape_values.items()] for row in by_name]
    shares = weights[kept] / weights[kept].sum()
    return ShapePosterior(points=tuple(map(tuple, table)), weights=tuple(float(f"{s:.6g}") for s in shares))


def _value(parameter: ShapeParameter, unit: float) -> float:
    """The parameter at a quantile of its prior."""
    if parameter.low == 0:
        return min(parameter.start * unit / max(1 - unit, 1e-12), parameter.high)
    return parameter.low + unit * (parameter.high - parameter.low)


def _log_marginal(parts: list[Evidence], weights: Floats) -> float:
    """Logarithm of the likelihood with all coefficients integrated out, up to a constant."""
    total = 0.0
    with np.errstate(divide="ignore"):
        for evidence in parts:
            exposure = float(weights @ evidence.exposure)
            if exposure > 0:
                n = len(evidence.at_events)
                total += float(np.log(evidence.at_events @ weights).sum()) - (n + 0.5) * np.log(exposure)
    return total


def _grid(log_density: Callable[[Floats], float], low: Floats, high: Floats, side: int) -> tuple[Floats, Floats]:
    """Cell centres (G, K) of a grid from low to high, and the share of the posterior (G,) of each."""
    axes = [a + (b - a) * (np.arange(side) + 0.5) / side for a, b in zip(low, high, strict=True)]
    points = np.array(list(product(*axes)))
    logs = np.array([log_density(point) for point in points])
    weights = np.exp(logs - logs.max())
    return points, weights / weights.sum()


def _where(points: Floats, weights: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """The box around all that the posterior holds, one cell wider."""
    kept = points[weights > REST * weights.max()]
    side = round(len(points) ** (1 / points.shape[1]))
    cell = (high - low) / side
    return np.maximum(kept.min(axis=0) - 1.5 * cell, low), np.minimum(kept.max(axis=0) + 1.5 * cell, high)
