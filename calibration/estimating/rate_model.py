"""The base of all models of rates: how the propensity of a channel depends on the state of the tank."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats


class ShapeParameter(NamedTuple):
    """A parameter that all channels share, such as an exponent, and the closed range in which it is looked for."""

    name: str
    low: float
    high: float


class RateModel(ABC):
    """A model of rates: the propensity of every channel, up to coefficients and shape parameters to be estimated.

    propensity of channel c = speed(age) * N_c * sum over terms t of (coefficient k_tc * h_tc(state))

    N_c : docking ways; age : tu since the start or the last restart. The coefficients are not negative, and each
    channel has its own. Shape parameters belong to all channels that are fitted together; they are fields of the
    model, whose values are where the search starts. Exposure, likelihood, intervals, tests, table and plot come with
    `fit_rates`.

    To add a model:
    1. write a frozen dataclass with a `name` and `combinations`, whose docstring states its assumption and its source;
    2. name its `terms` if they are more than one, and the fields that are `shape` parameters if it has any;
    3. where rates depend on the age, give `speed` and its integral, `elapsed`;
    4. import it in `calibration.estimating.models`: tests/contracts/test_estimators.py then tests it.
    """

    name: ClassVar[str]
    terms: ClassVar[tuple[str, ...]] = ("k",)
    shape: ClassVar[tuple[ShapeParameter, ...]] = ()

    @abstractmethod
    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """Per term, h (E + 1, R) in each state of the path: propensity per way and unit of the coefficient."""

    def speed(self, age: Floats) -> Floats:
        """Factor (n,) on all propensities at these ages, tu; 1 where rates do not depend on the age."""
        return np.ones_like(age)

    def elapsed(self, begin: Floats, end: Floats, origin: Floats) -> Floats:  # noqa: ARG002
        """Integral (n,) of `speed` from `begin` to `end`, tu; ages count from `origin`."""
        return end - begin
