"""The likelihood of fully observed jump paths, and its maximum.

For propensities a_c(t) that the path itself determines it is prod over events of a_c(t) exp(-sum_c integral a_c dt)
(Andersen, Borgan, Gill & Keiding 1993, section II.7): waits that the end cuts short enter through the integral, in
full. Given the shape parameters the channels part, and each is a concave problem in its own coefficients.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from calibration.estimating.exposure import require_same, sojourns
from calibration.estimating.mixed_evidence import MixedEvidence
from calibration.estimating.named_partners import of_the_named
from calibration.estimating.rate_model import RateModel
from calibration.estimating.shape_search import least
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats, Ints

STEPS = 100  # of Newton; five to ten are usual
SCATTERED = 128  # shapes tried at first
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


class _OfPath(NamedTuple):
    """Of one path: exposure (P, R') to each part, the channels (n,) that fired, and parts (n, P) at these events."""

    exposure: Floats
    fired: Ints
    at_events: Floats


class Maximum(NamedTuple):
    """Parameters of largest likelihood. model : with its shape; coefficients : (P, R') of the fitted channels."""

    log_likelihood: float
    model: RateModel
    coefficients: Floats


@dataclass(frozen=True, eq=False)
class PathLikelihood:
    """Log-likelihood of the firings of some channels in paths of one network, under a model of rates.

    channels : indices of these channels; what the others do is given

    Cost: one pass over the paths a set of shape parameters; one in all where the shape only weights parts (`mixture`).
    """

    model: RateModel
    paths: tuple[JumpPath, ...]
    channels: tuple[int, ...]
    _known: dict[Hashable, list[_OfPath]] = field(default_factory=dict, repr=False)
    _pooled: dict[Hashable, list[Evidence]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        for path in self.paths:
            require_same(self.paths[0].network, path.network)

    def among(self, chosen: Sequence[int]) -> PathLikelihood:
        """That of some of the paths, by number; nothing is collected anew."""
        known = {key: [each[i] for i in chosen] for key, each in self._known.items()}
        return PathLikelihood(self.model, tuple(self.paths[i] for i in chosen), self.channels, known)

    def evidence(self, model: RateModel) -> list[Evidence]:
        """One a channel, under the model with this shape."""
        parts, weights = self.parts(model), model.mixture()
        if weights is None:
            return parts
        return [Evidence(e.at_events @ weights.T, weights @ e.exposure) for e in parts]

    def parts(self, model: RateModel) -> list[Evidence]:
        """One a channel, in the parts that the model mixes to terms."""
        key = model.collected_as
        if key not in self._pooled:
            self._pooled.clear()  # one at a time: a search does not come back
            self._pooled[key] = self._collected(model)
        return self._pooled[key]

    @cached_property
    def mixed(self) -> MixedEvidence | None:
        """Of all channels together, where the shape only weights parts and every channel has one coefficient."""
        if self.model.mixture() is None or len(self.model.terms) > 1:
            return None
        parts = self.parts(self.model)
        return MixedEvidence.of([part.at_events for part in parts], [part.exposure for part in parts])

    def _collected(self, model: RateModel) -> list[Evidence]:
        key = model.collected_as
        if key not in self._known:
            self._known.clear()
            self._known[key] = [self._of_path(model, path) for path in self.paths]
        each = self._known[key]
        exposure = np.sum([one.exposure for one in each], axis=0)
        events, fired = np.concatenate([one.at_events for one in each]), np.concatenate([one.fired for one in each])
        return [Evidence(events[fired == c], exposure[:, i]) for i, c in enumerate(self.channels)]

    def _of_path(self, model: RateModel, path: JumpPath) -> _OfPath:
        chosen = list(self.channels)
        begin, end, origin = sojourns(path)
        terms = model.combinations(path)
        waits = model.elapsed(begin, end, origin)
        gathered = np.array([path.network.ways * (waits @ h) for h in terms])
        rows = np.flatnonzero(np.isin(path.channels, chosen))
        fired = path.channels[rows]
        speed = model.speed(path.times[rows] - origin[rows])
        at_events = np.array([path.network.ways[fired] * h[rows, fired] * speed for h in terms]).T
        named = model.named_parts(path)
        if named is not None:
            at_events = of_the_named(at_events, named[rows])
        return _OfPath((gathered * path.open_channels)[:, chosen], fired, at_events)

    def value(self, coefficients: Floats) -> float:
        """Log-likelihood of coefficients (P, R') under the model as it is."""
        evidence = self.evidence(self.model)
        return sum(e.log_likelihood(k) for e, k in zip(evidence, coefficients.T, strict=True))

    def maximum(
        self,
        fixed: Mapping[str, float] | None = None,
        held: tuple[int, int, float] | None = None,
        near: Mapping[str, float] | None = None,
    ) -> Maximum:
        """Largest log-likelihood, with shape parameters in `fixed` as given and, of `held`, one coefficient: term,
        position among the channels, value. The search starts at the shape `near`; None: at that of the model."""
        fixed = fixed or {}
        free = [parameter for parameter in self.model.shape if parameter.name not in fixed]
        mixed = self.mixed if free else None
        held_here = None if held is None else held[1:]

        def with_shape(values: Sequence[float]) -> RateModel:
            shape = {parameter.name: float(value) for parameter, value in zip(free, values, strict=True)}
            return self.model.with_shape(shape | dict(fixed))

        def at(values: Sequence[float]) -> Maximum:
            model = with_shape(values)
            best = [
                e.highest_with({held[0]: held[2]}) if held and held[1] == i else e.highest
                for i, e in enumerate(self.evidence(model))
            ]
            return Maximum(sum(value for _, value in best), model, np.array([k for k, _ in best]).T)

        def costs(table: Floats) -> Floats:
            if mixed is None:
                return np.array([-at(values).log_likelihood for values in table.tolist()])
            weights = np.concatenate([np.array(with_shape(values).mixture()) for values in table.tolist()])
            return -mixed.highest(weights, held_here)

        start = self.model.shape_values if near is None else near
        scattered = SCATTERED if mixed is not None and near is None else 0  # elsewhere each costs a pass over the paths
        return at(least(free, [start[parameter.name] for parameter in free], costs, scattered))


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
