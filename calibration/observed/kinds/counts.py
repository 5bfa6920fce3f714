"""Counts at times, of the same runs again and again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from calibration.observed.counts import read_counts
from calibration.observed.kinds.base import DataKind
from calibration.observed.tables import Table
from kinetics.markov.panels import PanelLikelihood
from kinetics.markov.panels.observations import Observation
from kinetics.network import Model


@dataclass(frozen=True)
class Counts(DataKind):
    """Counts of species or observables at some times, with nothing known of what happened in between; `read_counts`.

    initial : table of the states in which a run may start; None: as its first row and the model say

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from calibration import Counts
    >>> from kinetics import Network
    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.csv").write_text("time,A\\n0,1\\n2,1\\n")
    ...     Counts().read(Network.from_text("A -> B, 1"), f"{folder}/a.csv").value().value
    -2.0
    """

    name: ClassVar[str] = "counts"
    summary: ClassVar[str] = "Table of counts at times: time and a column for each species, see docs/your_data.md."

    initial: str | Path | Any = None

    @classmethod
    def told(cls, *, initial: str | Path | None = None, **_: Any) -> Self:
        """The kind with a table of starts."""
        return cls(initial)

    def of_table(self, model: Model, table: Table, observations: Mapping[str, Observation]) -> PanelLikelihood:
        """The likelihood of the counts in a table."""
        return PanelLikelihood(model, read_counts(model, table, observations, self.initial))
