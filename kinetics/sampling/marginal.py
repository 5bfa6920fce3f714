"""`Marginal`: how the counts of one species at one time are distributed over many runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kinetics.support import plots
from kinetics.support.arrays import Floats, Ints
from kinetics.support.shown import MOST_TIMES, ResultTable, Shown, on_axes
from kinetics.support.tables import in_unit


@dataclass(frozen=True, eq=False, repr=False)
class Marginal(Shown):
    """Counts of one species at one time, in K bins.

    time : in `time_unit`
    first, width : (K,) smallest count of each bin, and how many counts it holds
    share, low, high : (K,) of the runs, and the interval of the probability; each holds at `level` by itself
    """

    species: str
    time: float
    first: Ints
    width: int
    share: Floats
    low: Floats
    high: Floats
    level: float
    time_unit: str = ""
    place: int = 0

    @property
    def headline(self) -> str:
        """What it is of."""
        return f"copies of {self.species} at {in_unit(f'{self.time:g}', self.time_unit)} in {self.share.size} bins"

    def summary(self) -> ResultTable:
        """The likeliest bins with their intervals, in order."""
        shown = np.sort(np.argsort(-self.share, kind="stable")[:MOST_TIMES])
        bins = [f"{n}" if self.width == 1 else f"{n} to {n + self.width - 1}" for n in self.first[shown].tolist()]
        rows = [
            (name, f"{self.share[b]:.4g}", f"[{self.low[b]:.4g}, {self.high[b]:.4g}]")
            for name, b in zip(bins, shown, strict=True)
        ]
        return ResultTable(self.headline, ("copies", "share of runs", f"{100 * self.level:g} % interval"), rows)

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Shares with their intervals; returns `ax`."""
        middle = self.first + (self.width - 1) / 2
        spread = [np.maximum(self.share - self.low, 0.0), np.maximum(self.high - self.share, 0.0)]
        ax.errorbar(
            middle, self.share, spread, fmt="o", ms=3, capsize=2, color=plots.colour(self.place), label=self.species
        )
        ax.set_xlabel(f"copies of {self.species} at {in_unit(f'{self.time:g}', self.time_unit)}")
        ax.set_ylabel(f"share of runs ({100 * self.level:g} % intervals)" if self.width == 1 else "share of runs a bin")
        return ax
