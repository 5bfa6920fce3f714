"""What stands between a true count and the number that was written down."""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import inf
from typing import Any, ClassVar

import numpy as np

from kinetics.support.arrays import Floats


class Observation(ABC):
    """How a true count becomes the number in a table. To add one: a file with a subclass, and a line in OBSERVATIONS.

    name : in tables, commands and files
    is_certified : whether `weights` have no error
    most : the largest value of the parameter

    >>> from kinetics.markov.panels.observations import OBSERVATIONS
    >>> [each.name for each in OBSERVATIONS]
    ['exact', 'detected', 'rounded', 'censored', 'gaussian']
    """

    name: ClassVar[str]
    is_certified: ClassVar[bool] = False
    most: ClassVar[float] = inf

    @property
    def parameter(self) -> float | None:
        """The number that a fit may leave free; None if there is none."""
        return None

    @property
    def told(self) -> dict[str, Any]:
        """What a report says of it besides its name, ready for JSON."""
        return dict(vars(self))

    def words(self, seen: float) -> str:
        """What an error says was seen."""
        return f"{seen:g}"

    def with_parameter(self, value: float) -> Observation:  # noqa: ARG002
        """This observation model with another parameter."""
        raise ValueError(f"an observation that is {self.name} has no parameter")

    @abstractmethod
    def support(self, seen: float) -> tuple[float, float]:
        """The least and the largest true count at which this number may be seen.

        ValueError: it cannot be seen at any
        """

    @abstractmethod
    def weights(self, counts: Floats, seen: float) -> Floats:
        """Probability (N,), or density, that this number is seen at true counts (N,)."""

    @abstractmethod
    def drawn(self, counts: Floats, seen: float, rng: np.random.Generator) -> Floats:
        """Numbers (N,) that might be written down at true counts (N,), to be compared with the one that was, `seen`."""

    def slopes(self, counts: Floats, seen: float) -> Floats:  # noqa: ARG002
        """Derivatives (N,) of `weights` by the parameter."""
        raise ValueError(f"an observation that is {self.name} has no parameter")
