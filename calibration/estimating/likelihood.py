"""The likelihood of fully observed jump paths, and its maximum.

For propensities a_c(t) that the path itself determines it is prod over events of a_c(t) exp(-sum_c integral a_c dt)
(Andersen, Borgan, Gill & Keiding 1993, section II.7): waits that the end cuts short enter through the integral, in
full. Given the shape parameters the channels part, and each is a concave problem in its own coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from calibration.estimating.exposure import require_same, sojourns
from calibration.estimating.rate_model import RateModel, ShapeParameter
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats

STEPS = 100  # of Newton; five to ten are usual
RIDGE = 1e-10  # times the events, added to the curvature
ROUNDING = 1e-12  # loss of log-likelihood an event that no step is shortened for


@dataclass(frozen=True, eq=False)
class Evidence:
    """What paths say about one channel under one model and shape.

    at_events : (n, P) propensity at each event per unit of each coefficient
    exposure : (P,) integral of the same over the time that the channel was open
    """

    at_events: Floats
    exposure: Floats

    def log_likelihood(self, coefficients: Floats) -> float:
        """At coefficients (P,); nan counts as 0, -inf where an event that happened could not."""
        k = np.nan_to_num(coefficients)
        with np.errstate(divide="ignore"):
            return float(np.log(self.at_events @ k).sum() - self.exposure @ k)

    @cached_property
    def highest(self) -> tuple[Floats, float]:
        """Coefficients (P,) >= 0 of largest likelihood, nan without exposure; and that likelihood's logarithm."""
        return self.highest_with({})

    def highest_with(self, held: Mapping[int, float]) -> tuple[Floats, float]:
        """The same with some coefficients (term -> value) as given."""
        best = np.where(self.exposure > 0, 0.0, np.nan)
        best[list(held)] = list(held.values())
        free = [p for p in np.flatnonzero(self.exposure > 0) if p not in held]
        if free and len(self.at_events):
            given = self.at_events[:, list(held)] @ np.array(list(held.values()))
            best[free] = _maximum(self.at_events[:, free], self.exposure[free], given)
        return best, self.log_likelihood(best)


class Maximum(NamedTuple):
    """Parameters of largest likelihood. model : with its shape; coefficients : (P, R') of the fitted channels."""

    log_likelihood: float
    model: RateModel
    coefficients: Floats


@dataclass(frozen=True, eq=False)
class PathLikelihood:
    """Log-likelihood of the firings of some channels in paths of one network, under a model of rates.

    channels : indices of these channels; what the others do is given. Cost: one pass over the paths a set of shape
    parameters.
    """

    model: RateModel
    paths: tuple[JumpPath, ...]
    channels: tuple[int, ...]
    _known: dict[Hashable, list[Evidence]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        for path in self.paths:
            require_same(self.paths[0].network, path.network)

    def evidence(self, model: RateModel) -> list[Evidence]:
        """One a channel, under the model with this shape."""
        parts, weights = self.parts(model), model.mixture()
        if weights is None:
            return parts
        return [Evidence(e.at_events @ weights.T, weights @ e.exposure) for e in parts]

    def parts(self, model: RateModel) -> list[Evidence]:
        """One a channel, in the parts that the model mixes to terms."""
        key = model.collected_as
        if key not in self._known:
            self._known.clear()  # one at a time: a search does not come back
            self._known[key] = self._collected(model)
        return self._known[key]

    def _collected(self, model: RateModel) -> list[Evidence]:
        chosen = list(self.channels)
        exposure: Any = 0.0
        fired, at_events = [], []
        for path in self.paths:
            begin, end, origin = sojourns(path)
            terms = model.combinations(path)
            waits = model.elapsed(begin, end, origin)
            gathered = np.array([path.network.ways * (waits @ h) for h in terms])
            exposure = exposure + (gathered * path.open_channels)[:, chosen]
            rows = np.flatnonzero(np.isin(path.channels, chosen))
            channels = path.channels[rows]
            speed = model.speed(path.times[rows] - origin[rows])
            at_events.append(np.array([path.network.ways[channels] * h[rows, channels] * speed for h in terms]).T)
            fired.append(channels)
        events, each = np.concatenate(at_events), np.concatenate(fired)
        return [Evidence(events[each == c], exposure[:, i]) for i, c in enumerate(chosen)]

    def value(self, coefficients: Floats) -> float:
        """Log-likelihood of coefficients (P, R') under the model as it is."""
        evidence = self.evidence(self.model)
        return sum(e.log_likelihood(k) for e, k in zip(evidence, coefficients.T, strict=True))

    def maximum(self, fixed: Mapping[str, float] | None = None, held: tuple[int, int, float] | None = None) -> Maximum:
        """Largest log-likelihood, with shape parameters in `fixed` as given and, of `held`, one coefficient: term,
        position among the channels, value."""
        fixed = fixed or {}
        free = [parameter for parameter in self.model.shape if parameter.name not in fixed]

        def at(values: Sequence[float]) -> Maximum:
            shape = {parameter.name: float(value) for parameter, value in zip(free, values, strict=True)}
            model = self.model.with_shape(shape | dict(fixed))
            evidence = self.evidence(model)
            best = [
                e.highest_with({held[0]: held[2]}) if held and held[1] == i else e.highest
                for i, e in enumerate(evidence)
            ]
            return Maximum(sum(value for _, value in best), model, np.array([k for k, _ in best]).T)

        start = [self.model.shape_values[parameter.name] for parameter in free]
        return at(_searched(free, start, lambda values: -at(values).log_likelihood))


def _searched(
    free: Sequence[ShapeParameter], start: Sequence[float], cost: Callable[[Sequence[float]], float]
) -> Sequence[float]:
    """Values of the shape parameters at which `cost` is least: one valley is supposed, and no derivative is asked."""
    from scipy.optimize import minimize, minimize_scalar

    def finite(*values: float) -> float:
        return min(cost(values), 1e300)

    if not free:
        return []
    if len(free) == 1:
        (only,) = free
        span = only.high - only.low
        inside = minimize_scalar(finite, bounds=(only.low, only.high), options={"xatol": 1e-7 * span}).x
        if min(inside - only.low, only.high - inside) > 1e-6 * span:
            return [inside]
        return [min((only.low, only.high), key=finite)]  # the search stops short of an end
    found = minimize(  # type: ignore[call-overload]  # the stubs know no plain dict of options
        lambda values: finite(*values),
        np.array(start),
        method="Nelder-Mead",
        bounds=[(parameter.low, parameter.high) for parameter in free],
        options={"xatol": 1e-8, "fatol": 1e-10, "maxiter": 1000 * len(free)},
    )
    return list(found.x)


def _maximum(x: Floats, exposure: Floats, given: Floats) -> Floats:
    """Coefficients k (P,) >= 0 that maximise sum log(given + x k) - exposure k, a concave function.

    x : (n, P), n > 0; given : (n,) what a coefficient that is held adds at each event
    """
    n, terms = x.shape
    if terms == 1 and not given.any():
        return np.asarray(n / exposure)
    if not (given + x.sum(axis=1) > 0).all():
        return np.zeros(terms)  # an event that none of them explains: the likelihood is 0 whatever they are
    scale = n / exposure  # the unit of k is the one with which its term alone would explain all events
    z = x * scale

    def value(u: Floats) -> float:
        m = given + z @ u
        return float(np.log(m).sum() - n * u.sum()) if (m > 0).all() else -np.inf

    # Newton's steps, projected on u >= 0, leave out terms at 0 that would fall further (Bertsekas 1982).
    u = np.full(terms, 1 / terms)
    for _ in range(STEPS):
        weighted = z / (given + z @ u)[:, None]
        gradient = weighted.sum(axis=0) - n
        free = (u > 0) | (gradient > 0)
        step = np.zeros(terms)
        # the ridge moves terms that the events say nothing of, and decides between terms that no event can distinguish
        curvature = weighted[:, free].T @ weighted[:, free] + RIDGE * n * np.eye(int(free.sum()))
        step[free] = np.linalg.solve(curvature, gradient[free])
        if (np.abs(step) < 1e-14).all():
            break
        length, least = 1.0, value(u) - ROUNDING * n
        while value(np.maximum(u + length * step, 0.0)) < least and length > 1e-9:
            length /= 2
        u = np.maximum(u + length * step, 0.0)
    return np.asarray(u * scale)
