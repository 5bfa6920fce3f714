"""The derivatives of an answer by the parameters of a chain's rates, and its elasticities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kinetics.support import plots
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, read_only
from kinetics.support.shown import ResultTable, Shown, on_axes
from kinetics.support.tables import figure, text_table

ROUNDED = 2.0**-52  # of a quotient


@dataclass(frozen=True, eq=False, repr=False)
class Derivatives(Shown):
    """The derivatives of an answer by the logarithm of each of P parameters: d answer / d ln(parameter).

    parameters : names (P,), of channels for their rate constants
    answer : the answer itself, with its bounds
    value, low, high : (P,) in the units of the answer, and bounds of the true ones; all roundings and truncations, and
        those of the rates, included
    is_bound : whether the bounds are proven; otherwise they are an estimate
    constants : (P,) values of the parameters, 1/tu; of a rate law the factor before it. None if they are not known
    method : how they were found
    cpu_seconds : time that took

    >>> from kinetics import Chain, Network, Sensitivity
    >>> gradient = Sensitivity(Chain.of(Network.from_text("A <-> B, 2, 3"), {"A": 1})).steady_state("B == 1")
    >>> gradient.value.round(9).tolist(), gradient.elasticity.round(9).tolist(), gradient.is_bound  # 0.4 * 0.6
    ([0.24, -0.24], [0.6, -0.6], True)
    """

    parameters: tuple[str, ...]
    answer: Answer
    value: Floats
    low: Floats
    high: Floats
    is_bound: bool
    constants: Floats | None
    method: str
    cpu_seconds: float

    def __post_init__(self) -> None:
        for array in (self.value, self.low, self.high):
            read_only(array)

    @property
    def elasticity(self) -> Floats:
        """Relative change (P,) of the answer per relative change of each parameter; nan if the answer is 0."""
        return self._over(np.full(self.value.size, self.answer.value))

    @property
    def elasticity_bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds (P,) of `elasticity`; infinite where the answer may be 0."""
        ends = self.answer.low, self.answer.high
        if ends[0] <= 0.0:
            return np.full(self.value.size, -np.inf), np.full(self.value.size, np.inf)
        low = self.low / np.where(self.low < 0, *ends)
        high = self.high / np.where(self.high < 0, ends[1], ends[0])
        return low - ROUNDED * np.abs(low), high + ROUNDED * np.abs(high)

    @property
    def by_constant(self) -> Floats:
        """Derivatives (P,) by the parameters themselves; nan where these are 0 or unknown."""
        constants = np.zeros(self.value.size) if self.constants is None else self.constants
        return self._over(constants)

    def _over(self, by: Floats) -> Floats:
        return self.value / np.where(by == 0.0, np.nan, by)

    def to_dict(self) -> dict[str, Any]:
        """The derivatives as a dictionary, ready for JSON; arrays are (P,)."""
        low, high = self.elasticity_bounds
        return {
            "parameters": self.parameters,
            "answer": self.answer.to_dict(),
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "is_bound": self.is_bound,
            "constants": self.constants,
            "by_constant": self.by_constant,
            "elasticity": self.elasticity,
            "elasticity_low": low,
            "elasticity_high": high,
            "method": self.method,
            "cpu_seconds": self.cpu_seconds,
        }

    @property
    def headline(self) -> str:
        """One line: the answer, the number of parameters and the method."""
        return f"derivatives of {self.answer.value:.6g} by {len(self.parameters)} parameters; method {self.method}"

    def summary(self) -> ResultTable:
        """Elasticity with its error and derivative, a row a parameter."""
        low, high = self.elasticity_bounds
        wide = np.maximum(high - self.elasticity, self.elasticity - low)
        rows = [
            (name, figure(elasticity, ".6g"), figure(error, ".1e"), f"{value:.6g}")
            for name, elasticity, error, value in zip(self.parameters, self.elasticity, wide, self.value, strict=True)
        ]
        kind = "proven" if self.is_bound else "estimated"
        note = f"of {self.answer.value:.12g}; bounds {kind}; {self.method}; {self.cpu_seconds:.2g} s CPU"
        return ResultTable(self.headline, ("parameter", "elasticity", "+-", "d / d ln"), rows, [note])

    def __str__(self) -> str:
        table = self.summary()
        return "\n".join([text_table(table.titles, table.rows), *table.notes])

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Bars of the elasticities with their bounds, the first parameter on top; returns `ax`."""
        values, low, high = (np.reshape(each, (-1, 1)) for each in (self.elasticity, *self.elasticity_bounds))
        return plots.grouped_bars(ax, self.parameters, ("elasticity",), values, low, high, "d ln(answer) / d ln(rate)")
