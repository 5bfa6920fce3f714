"""Snapshots: independent copies, each counted once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from calibration.observed.counts import read_snapshots
from calibration.observed.kinds.base import DataKind
from calibration.observed.tables import Table
from kinetics.markov.panels import PanelLikelihood
from kinetics.markov.panels.observations import Observation
from kinetics.network import Model


@dataclass(frozen=True)
class Snapshots(DataKind):
    """Independent copies that started as the model says and were counted once each; `read_snapshots`.

    initial : table of the states in which a copy may start; None: the counts of the model

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from calibration import Snapshots
    >>> from kinetics import Model, Network
    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.csv").write_text("time,A\\n2,1\\n3,1\\n")
    ...     Snapshots().read(Model(Network.from_text("A -> B, 1"), {"A": 1}), f"{folder}/a.csv").value().value
    -5.0
    """

    name: ClassVar[str] = "snapshots"
    summary: ClassVar[str] = "Table of independent copies, each counted once: time since the start, and counts."

    initial: str | Path | Any = None

    @classmethod
    def told(cls, *, initial: str | Path | None = None, **_: Any) -> Self:
        """The kind with a table of starts."""
        return cls(initial)

    def of_table(self, model: Model, table: Table, observations: Mapping[str, Observation]) -> PanelLikelihood:
        """The likelihood of the copies in a table."""
        return PanelLikelihood(model, read_snapshots(model, table, observations, self.initial))
