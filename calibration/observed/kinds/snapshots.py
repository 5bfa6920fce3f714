"""Snapshots: independent copies, each counted once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from calibration.observed.counts import read_snapshots
from calibration.observed.kinds.base import DataKind
from calibration.observed.tables import Table
from kinetics.markov.panels import PanelLikelihood
from kinetics.markov.panels.observations import Observation
from kinetics.network import Model


@dataclass(frozen=True)
class Snapshots(DataKind):
    """Independent copies that started as the model says and were counted once each; `read_snapshots`.

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

    def of_table(self, model: Model, table: Table, observations: Mapping[str, Observation]) -> PanelLikelihood:
        """The likelihood of the copies in a table."""
        return PanelLikelihood(model, read_snapshots(model, table, observations))
