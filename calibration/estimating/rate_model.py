"""The base of all models of rates: how the propensity of a channel depends on the state of the tank."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from calibration.estimating.exposure import sojourns
from kinetics.rates.breaks import ShapeParameter
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats, Ints


@dataclass(frozen=True)
class RateModel(ABC):
    """A model of rates: the propensity of every channel, up to coefficients and shape parameters to be estimated.

    propensity of channel c = speed(age) * N_c * sum over terms t of (coefficient k_tc * h_tc(state))

    N_c : docking ways; age : tu since the start or the last restart. The coefficients are not negative, and each
    channel has its own. Shape parameters belong to all channels that are fitted together; they are fields of the
    model, whose values are where the search starts. Exposure, likelihood, intervals, tests, table and plot come with
    `fit_rates`. If the shape only weights parts that do not depend on it, `combinations` gives the parts and
    `mixture` the weights, so that a search passes over the paths once.

    To add a model:
    1. write a frozen dataclass with a `name` and `combinations`, whose docstring states its assumption and its source;
    2. name its `terms` if they are more than one, and the fields that are `shape` parameters if it has any;
    3. where rates depend on the age, give `speed` and its integral, `elapsed`;
    4. import it in `calibration.estimating.models`: tests/contracts/test_estimators.py then tests it.

    >>> from calibration import RATE_MODELS, Weibull
    >>> {model.name: (model.terms, list(model.shape_values)) for model in RATE_MODELS}
    {'mass-action': (('k',), []), 'weibull': (('k',), ['kappa']), 'crowded': (('k', 'c'), [])}
    >>> Weibull(kappa=2.0).elapsed(begin=1.0, end=3.0, origin=0.0).item()  # 3^2 - 1^2
    8.0
    """

    name: ClassVar[str]
    terms: ClassVar[tuple[str, ...]] = ("k",)
    shape: ClassVar[tuple[ShapeParameter, ...]] = ()

    @abstractmethod
    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """Per part, h (E + 1, R) in each state of the path: propensity per way and unit of the coefficient.

        The parts are the terms, unless there is a `mixture`.
        """

    def collected(self, path: JumpPath, rows: Ints) -> tuple[Floats, Floats]:
        """Integrals (parts, R) of the propensity's parts over a path, and parts (n, parts) at the events in `rows`.

        Both are per unit of the coefficients, ways counted; a channel that is closed has no integral.
        """
        begin, end, origin = sojourns(path)
        fired = path.channels[rows]
        waits = self.elapsed(begin, end, origin)
        speed = self.speed(path.times[rows] - origin[rows])
        parts = self.combinations(path)
        integrals = np.array([path.network.ways * (waits @ h) for h in parts]) * path.open_channels
        return integrals, np.array([path.network.ways[fired] * h[rows, fired] * speed for h in parts]).T

    def mixture(self) -> Floats | None:
        """Weights (terms, parts) of the parts in each term; None if the parts are the terms."""
        return None

    def in_terms(self, path: JumpPath) -> Sequence[Floats]:
        """Per term, h (E + 1, R) in each state of the path."""
        parts, weights = self.combinations(path), self.mixture()
        return parts if weights is None else list(np.tensordot(weights, np.array(parts), axes=1))

    @property
    def cache_key(self) -> Hashable:
        """A key of all that the parts depend on: models with equal keys share what is collected from paths."""
        return self

    def with_shape(self, values: Mapping[str, float]) -> Self:
        """A copy of the model with these values of some of its shape parameters."""
        return replace(self, **values)

    @property
    def shape_values(self) -> dict[str, float]:
        """The shape parameters by name."""
        return {parameter.name: getattr(self, parameter.name) for parameter in self.shape}

    def speed(self, age: Floats) -> Floats:
        """Factor (n,) on all propensities at these ages, tu; 1 if rates do not depend on the age."""
        return np.ones_like(age)

    def elapsed(self, begin: Floats, end: Floats, origin: Floats) -> Floats:  # noqa: ARG002
        """Integral (n,) of `speed` from `begin` to `end`, tu; ages count from `origin`."""
        return end - begin
