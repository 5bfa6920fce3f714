"""Relative differences of two settings with their intervals, from blocks that belong together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinetics.support.intervals import student_quantile


@dataclass(frozen=True)
class RelativeChange:
    """A relative difference and half the width of its 95 % interval."""

    value: float
    half_width: float

    @property
    def limit(self) -> float:
        """The largest magnitude within the interval."""
        return abs(self.value) + self.half_width

    @property
    def shown(self) -> float:
        """The least magnitude within the interval: 0 where it holds 0."""
        return max(0.0, abs(self.value) - self.half_width)

    def as_dict(self) -> dict[str, float]:
        """For JSON."""
        return {"value": self.value, "half_width_95": self.half_width}

    def __str__(self) -> str:
        return f"{100 * self.value:+.2f} ± {100 * self.half_width:.2f} %"


@dataclass(frozen=True)
class Mean:
    """A mean and half the width of its 95 % interval."""

    value: float
    half_width: float

    def as_dict(self) -> dict[str, float]:
        """For JSON."""
        return {"value": self.value, "half_width_95": self.half_width}


def change_of(blocks: np.ndarray, reference: np.ndarray) -> RelativeChange:
    """Relative difference of two means from blocks (B,) that belong together one by one, with its 95 % interval.

    The ratio estimator sum(x) / sum(r) - 1, its error from the scatter of x - ratio r (Cochran, Sampling Techniques,
    1977, section 6.3); bias of order 1 / B. What both share within a block cancels; nothing is assumed of it.
    """
    ratio = blocks.sum() / reference.sum()
    scatter = np.std(blocks - ratio * reference, ddof=1) / np.sqrt(blocks.size) / reference.mean()
    return RelativeChange(float(ratio - 1), float(student_quantile(blocks.size - 1) * scatter))


def mean_of(blocks: np.ndarray) -> Mean:
    """Mean of blocks (B,) with its 95 % interval, by Student's t."""
    error = np.std(blocks, ddof=1) / np.sqrt(blocks.size)
    return Mean(float(blocks.mean()), float(student_quantile(blocks.size - 1) * error))
