"""Events, each with its time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from calibration.observed.kinds.base import DataKind
from calibration.observed.reading import read_events
from calibration.observed.tables import Table
from kinetics.markov.panels import EventLikelihood
from kinetics.markov.panels.observations import Observation
from kinetics.network import Model, Tank


@dataclass(frozen=True)
class Events(DataKind):
    """Every event with its time, and its channel or those of which it may be; `read_events`.

    runs, cubes, single, tank : as in `read_events`

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from calibration import Events
    >>> from kinetics import Network
    >>> with TemporaryDirectory() as folder:
    ...     _ = Path(folder, "a.csv").write_text("run,time,channel,A\\nx,0,start,1\\nx,2,end,1\\n")
    ...     Events().read(Network.from_text("A -> B, 1"), f"{folder}/a.csv").value().value
    -2.0
    """

    name: ClassVar[str] = "events"
    summary: ClassVar[str] = "Table of events (CSV or Parquet): run, time and channel, see docs/observed_events.md."
    is_counted: ClassVar[bool] = False

    runs: str | Path | None = None
    cubes: int | None = None
    single: str | None = None
    tank: Tank | None = None

    @classmethod
    def told(cls, *, initial: str | Path | None = None, **known: Any) -> Self:  # noqa: ARG003
        """The kind with these fields; a start belongs to counts."""
        return cls(**known)

    def of_table(self, model: Model, table: Table, observations: Mapping[str, Observation]) -> EventLikelihood:
        """The likelihood of the events in a table."""
        if observations:
            raise ValueError(f"{next(iter(observations))}: events are observed as they are; give counts instead")
        given = {"cubes": self.cubes, "single": self.single, "tank": self.tank}
        return EventLikelihood(model, read_events(model.network, table, self.runs, **given))  # type: ignore[arg-type]
