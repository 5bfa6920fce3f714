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

from calibration.estimating.grouping import Grouping
from calibration.estimating.mixed_evidence import MixedEvidence
from calibration.estimating.rate_model import RateModel
from calibration.estimating.shape_search import least
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats, Ints, divided

STEPS = 100  # of Newton; five to ten are usual
SCATTERED = 128  # shapes tried at first
RIDGE = 1e-10  # times the events, added to the curvature
ROUNDS = 1000  # of expectation maximisation, at most
EXACT = 1e-9  # of all events: what it may still move
ROUNDING = 1e-12  # loss of log-likelihood an event that no step is shortened for


@dataclass(frozen=True, eq=False)
class Evidence:
    """The evidence of paths on one channel under one model and shape.

    at_events : (n, P) propensity at each event per unit of each coefficient
    exposure : (P,) integral of the same over the time that the channel was open
    """

    at_events: Floats
    exposure: Floats

    def log_likelihood(self, coefficients: Floats) -> float:
        """The log-likelihood at coefficients (P,); nan counts as 0, -inf if an event that happened could not."""
        k = np.nan_to_num(coefficients)
        with np.errstate(divide="ignore"):
            return float(np.log(self.at_events @ k).sum() - self.exposure @ k)

    @cached_property
    def mle(self) -> tuple[Floats, float]:
        """Coefficients (P,) >= 0 of largest likelihood, nan without exposure; and that likelihood's logarithm."""
        return self.mle_with({})

    def mle_with(self, held: Mapping[int, float]) -> tuple[Floats, float]:
        """Coefficients of largest likelihood with some (term -> value) as given, and the likelihood's logarithm."""
        best = np.where(self.exposure > 0, 0.0, np.nan)
        best[list(held)] = list(held.values())
        free = [p for p in np.flatnonzero(self.exposure > 0) if p not in held]
        if free and len(self.at_events):
            given = self.at_events[:, list(held)] @ np.array(list(held.values()))
            best[free] = _maximum(self.at_events[:, free], self.exposure[free], given)
        return best, self.log_likelihood(best)


class _OfPath(NamedTuple):
    """Evidence of one path: exposure (P, L) of each sort of channel, sorts (n,) fired, and parts (n, P) at events."""

    exposure: Floats
    fired: Ints
    at_events: Floats


class Maximum(NamedTuple):
    """Parameters of largest likelihood.

    model : with its shape; coefficients : (P, K) of the constants, nan without exposure
    events : (K,) of each constant, those of channels with several shared out
    """

    log_likelihood: float
    model: RateModel
    coefficients: Floats
    events: Floats


@dataclass(frozen=True, eq=False)
class PathLikelihood:
    """Log-likelihood of the firings of some channels in paths, under a model of rates.

    grouping : the channels, and the constants that they have; what other channels do is given

    Cost: one pass over the paths a set of shape parameters; one in all where the shape only weights parts (`mixture`).
    """

    model: RateModel
    paths: tuple[JumpPath, ...]
    grouping: Grouping
    _known: dict[Hashable, list[_OfPath]] = field(default_factory=dict, repr=False)
    _pooled: dict[Hashable, list[Evidence]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        for path in self.paths:
            self.grouping.sorts_of(path.network)

    def subset(self, chosen: Sequence[int]) -> PathLikelihood:
        """The likelihood of some of the paths, by number; nothing is collected anew."""
        known = {key: [each[i] for i in chosen] for key, each in self._known.items()}
        return PathLikelihood(self.model, tuple(self.paths[i] for i in chosen), self.grouping, known)

    def of(self, model: RateModel, grouping: Grouping) -> PathLikelihood:
        """The likelihood of the same paths under another model and other constants of the same sorts of channels.

        What both models need of the paths alike (`cache_key`) is collected once.
        """
        return PathLikelihood(model, self.paths, grouping, self._known)

    @property
    def channels(self) -> tuple[int, ...]:
        """Positions of the channels, each of which has its own constant; ValueError if constants are shared."""
        network = self.paths[0].network
        if any(key not in network.channel_places for key in self.grouping.keys):
            raise ValueError("constants that channels share belong to no channel; group by channel")
        return tuple(network.channel_places[key] for key in self.grouping.keys)

    def evidence(self, model: RateModel) -> list[Evidence]:
        """One a constant, under the model with this shape."""
        parts, weights = self.parts(model), model.mixture()
        if weights is None:
            return parts
        return [Evidence(e.at_events @ weights.T, weights @ e.exposure) for e in parts]

    def parts(self, model: RateModel) -> list[Evidence]:
        """One a constant, in the parts that the model mixes to terms; events of several constants are in none."""
        key = model.cache_key
        if key not in self._pooled:
            self._pooled.clear()  # one at a time: a search does not come back
            fired, at_events = self._events(model)
            of = np.where(np.count_nonzero(self.grouping.shares, axis=1) == 1, self.grouping.shares.argmax(axis=1), -1)
            exposure = self._exposure(model)
            self._pooled[key] = [Evidence(at_events[of[fired] == k], e) for k, e in enumerate(exposure.T)]
        return self._pooled[key]

    def exposure(self, model: RateModel) -> Floats:
        """Exposure (K, P) of each constant to each part."""
        return np.ascontiguousarray(self._exposure(model).T)

    def _exposure(self, model: RateModel) -> Floats:
        total = np.sum([one.exposure for one in self._collected(model)], axis=0)
        return np.asarray(total @ self.grouping.shares)

    def mixed(self, events: Floats) -> MixedEvidence | None:
        """The evidence on all constants together; None unless the shape only weights parts and the model has one term.

        events : (K,) of each constant
        """
        if self.model.mixture() is None or len(self.model.terms) > 1:
            return None
        if self.model.cache_key not in self._mixtures:
            each, copies = np.unique(self._events(self.model)[1], axis=0, return_counts=True)
            self._mixtures[self.model.cache_key] = each, copies, self.exposure(self.model)
        return MixedEvidence(*self._mixtures[self.model.cache_key], events)

    @cached_property
    def _mixtures(self) -> dict[Hashable, tuple[Floats, Ints, Floats]]:
        return {}

    def _events(self, model: RateModel) -> tuple[Ints, Floats]:
        """Sorts (n,) of all events, and parts (n, P) at them."""
        each = self._collected(model)
        return np.concatenate([one.fired for one in each]), np.concatenate([one.at_events for one in each])

    def _collected(self, model: RateModel) -> list[_OfPath]:
        key = model.cache_key
        if key not in self._known:
            self._known.clear()
            self._known[key] = [self._of_path(model, path) for path in self.paths]
        return self._known[key]

    def _of_path(self, model: RateModel, path: JumpPath) -> _OfPath:
        sorts = self.grouping.sorts_of(path.network)
        chosen = sorts >= 0
        rows = np.flatnonzero((path.channels != RESTART) & chosen[path.channels])
        integrals, at_events = model.collected(path, rows)
        most = len(self.grouping.shares)
        exposure = np.array([np.bincount(sorts[chosen], row[chosen], minlength=most) for row in integrals])
        return _OfPath(exposure, sorts[path.channels[rows]], at_events)

    @cached_property
    def counts(self) -> Floats:
        """Events (L,) of each sort of channel."""
        sorts = [self.grouping.sorts_of(p.network)[p.channels[p.channels != RESTART]] for p in self.paths]
        fired = np.concatenate(sorts)
        return np.bincount(fired[fired >= 0], minlength=len(self.grouping.shares)).astype(np.float64)

    def value(self, coefficients: Floats) -> float:
        """Log-likelihood of coefficients (P, K) under the model as it is."""
        evidence = self.evidence(self.model)
        return sum(e.log_likelihood(k) for e, k in zip(evidence, coefficients.T, strict=True))

    def maximum(
        self,
        fixed: Mapping[str, float] | None = None,
        held: tuple[int, int, float] | None = None,
        near: Mapping[str, float] | None = None,
    ) -> Maximum:
        """Largest log-likelihood, with shape parameters in `fixed` as given and, of `held`, one coefficient: term,
        position among the constants, value. The search starts at the shape `near`; None: at that of the model."""
        if self.grouping.is_mixed:
            if held is not None:
                raise ValueError("events of several constants are shared out; no coefficient can be held at a value")
            return self._shared_out(fixed or {}, near)
        events = self.counts @ self.grouping.shares
        model = self._shaped(events, fixed or {}, held, near)
        return self._at(model, events, held)

    def _at(self, model: RateModel, events: Floats, held: tuple[int, int, float] | None) -> Maximum:
        """Largest log-likelihood of the coefficients, given the shape."""
        best = [
            e.mle_with({held[0]: held[2]}) if held and held[1] == i else e.mle
            for i, e in enumerate(self.evidence(model))
        ]
        return Maximum(sum(value for _, value in best), model, np.array([k for k, _ in best]).T, events)

    def _shaped(
        self,
        events: Floats,
        fixed: Mapping[str, float],
        held: tuple[int, int, float] | None = None,
        near: Mapping[str, float] | None = None,
    ) -> RateModel:
        """The model with the shape of largest likelihood, given the events of each constant."""
        free = [parameter for parameter in self.model.shape if parameter.name not in fixed]
        mixed = self.mixed(events) if free else None
        held_here = None if held is None else held[1:]

        def with_shape(values: Sequence[float]) -> RateModel:
            shape = {parameter.name: float(value) for parameter, value in zip(free, values, strict=True)}
            return self.model.with_shape(shape | dict(fixed))

        def costs(table: Floats) -> Floats:
            if mixed is None:
                return np.array([-self._at(with_shape(row), events, held).log_likelihood for row in table.tolist()])
            weights = np.concatenate([np.array(with_shape(values).mixture()) for values in table.tolist()])
            return -mixed.mle(weights, held_here)

        start = self.model.shape_values if near is None else near
        scattered = SCATTERED if mixed is not None and near is None else 0  # elsewhere each costs a pass over the paths
        return with_shape(least(free, [start[parameter.name] for parameter in free], costs, scattered))

    def _shared_out(self, fixed: Mapping[str, float], near: Mapping[str, float] | None) -> Maximum:
        """Share the events of channels among their constants by expectation, and repeat to convergence (EM).

        This is expectation maximisation (Dempster, Laird & Rubin 1977, J. R. Stat. Soc. B 39, 1), which converges to
        the largest likelihood. ValueError: a model of several coefficients, or whose shape does more than weight parts.
        """
        if len(self.model.terms) > 1 or (self.model.shape and self.model.mixture() is None):
            raise ValueError(f"{self.model.name}: events of several constants are shared out for one coefficient each")
        shares, model, near_here = self.grouping.shares, self.model, near
        parts = self.exposure(model)

        def expected(constants: Floats) -> Floats:
            """Events (K,) of each constant."""
            each = shares * constants
            total = each.sum(axis=1, keepdims=True)
            return self.counts @ divided(each, total)

        enough = EXACT * self.counts.sum()
        events = expected(np.ones(len(self.grouping.keys)))
        for _ in range(ROUNDS):
            before = events
            model = self._shaped(events, fixed, near=near_here)
            near_here = model.shape_values
            weights = model.mixture()
            exposure = parts[:, 0] if weights is None else parts @ weights[0]
            for _ in range(ROUNDS):
                constants = divided(events, exposure)
                last, events = events, expected(constants)
                if np.abs(events - last).max(initial=0.0) <= enough:
                    break
            if np.abs(events - before).max(initial=0.0) <= enough:
                break
        fired, at_events = self._events(model)
        mixed = at_events[:, 0] if weights is None else at_events @ weights[0]
        with np.errstate(divide="ignore"):
            value = float(np.log((shares @ constants)[fired] * mixed).sum() - exposure @ constants)
        return Maximum(value, model, np.where(exposure > 0, constants, np.nan)[None], events)


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
