"""The search for shape parameters of largest likelihood, in quantiles of their priors, 0 to 1."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kinetics.rates.breaks import ShapeParameter
from kinetics.support.arrays import Floats
from kinetics.support.packages import optimize, stats

IMPOSSIBLE = 1e300  # a cost that a search can compare, where it is infinite
TOLERANCE = 1e-10  # of the cost
STEP = 1e-5  # of the differences that stand for derivatives


def least(
    free: Sequence[ShapeParameter], start: Sequence[float], costs: Callable[[Floats], Floats], scattered: int = 0
) -> Sequence[float]:
    """Values (K,) of the shape parameters at which the cost is least; no derivative is asked.

    costs : cost (G,) at each of the values (G, K)
    scattered : points all over the ranges that are tried, the best of which is a second start; 0 supposes one valley

    One parameter is found by Brent's method, several by L-BFGS-B with central differences, and where that fails, as on
    a valley with kinks, by the simplex of Nelder and Mead.
    """
    known = 0.0

    def at(units: Floats) -> Floats:
        values = np.array([p.value(u) for p, u in zip(free, units.T, strict=True)]).T
        return np.minimum(costs(values), IMPOSSIBLE) - known

    def one(units: Floats) -> float:
        return float(at(np.atleast_2d(units))[0])

    def with_slope(units: Floats) -> tuple[float, Floats]:
        up = np.minimum(units + STEP * np.eye(units.size), 1.0)
        down = np.maximum(units - STEP * np.eye(units.size), 0.0)
        found = at(np.vstack([units, up, down]))
        rise = found[1 : units.size + 1] - found[units.size + 1 :]
        return float(found[0]), rise / (up - down).diagonal()

    if not free:
        return []
    if len(free) == 1:
        (only,) = free
        inside = float(
            optimize.minimize_scalar(lambda u: one(np.array([u])), bounds=(0.0, 1.0), options={"xatol": 1e-7}).x
        )
        if min(inside, 1 - inside) < 1e-6:  # it stops short of an end
            return [min((only.low, only.high), key=lambda value: float(costs(np.array([[value]]))[0]))]
        return [float(only.value(inside))]
    starts = [np.clip([p.unit(value) for p, value in zip(free, start, strict=True)], 0.0, 1.0)]
    if scattered:
        points = stats.qmc.Halton(len(free), scramble=False).random(scattered + 1)[1:]  # the first one is a corner
        starts.append(points[np.argmin(at(points))])
    known = one(starts[0])  # taken off, so that tolerances are in units of log-likelihood
    bounds = [(0.0, 1.0)] * len(free)
    ends = []
    for units in starts:
        end = optimize.minimize(
            with_slope, units, method="L-BFGS-B", jac=True, bounds=bounds, options={"ftol": TOLERANCE}
        )
        if not end.success:
            end = optimize.minimize(
                one, end.x, method="Nelder-Mead", bounds=bounds,
                options={"xatol": 1e-8, "fatol": 1e-10, "maxiter": 1000 * len(free)},
            )  # fmt: skip
        ends.append(end)
    best = min(ends, key=lambda end: float(end.fun))
    return [float(np.clip(p.value(u), p.low, p.high)) for p, u in zip(free, best.x.tolist(), strict=True)]
