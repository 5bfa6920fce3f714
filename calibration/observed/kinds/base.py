"""The base of all kinds of data that others recorded: how a table becomes a likelihood."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from calibration.observed.tables import Table, read_table
from kinetics.markov.panels import JointLikelihood, Likelihood
from kinetics.markov.panels.observations import Observation
from kinetics.network import Model, Network

GROUP = "group"


@dataclass(frozen=True)
class DataKind(ABC):
    """A kind of data.

    To add a kind:
    1. write a frozen dataclass with a `name`, which is its option of `wellmixed calibrate`, and a `summary`, its help;
    2. give in `of_table` the likelihood of a table; errors name file and line;
    3. import it in `calibration.observed.kinds`: tests/contracts/test_data_kinds.py then tests it.

    >>> from calibration.observed.kinds import DATA_KINDS
    >>> [kind.name for kind in DATA_KINDS]
    ['events', 'counts', 'snapshots']
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    is_counted: ClassVar[bool] = True  # whether columns hold counts, which may be observed with an error

    @classmethod
    def told(cls, **known: Any) -> Self:  # noqa: ARG003
        """The kind with what is known of the runs besides the table; by default it needs nothing."""
        return cls()

    @abstractmethod
    def of_table(self, model: Model, table: Table, observations: Mapping[str, Observation]) -> Likelihood:
        """The likelihood of the data in a table. ValueError: a table that is wrong"""

    def read(
        self,
        model: Model | Network,
        table: str | Path | Any,
        observations: Mapping[str, Observation] | None = None,
        own: Sequence[str] = (),
    ) -> Likelihood:
        """The likelihood of a file (CSV or Parquet), or of a data frame of pandas.

        observations : column -> how its numbers come from true counts; exact for those not named
        own : parameters of which each group of runs has its own; the table then has a column `group`
        """
        given, whole = Model.of(model), read_table(table)
        if GROUP not in whole.columns or GROUP in given.network.species_places:
            if own:
                raise ValueError(f"{whole.name} has no column {GROUP!r}, by which {own[0]} would differ")
            return self.of_table(given, whole, observations or {})
        names = whole.columns[GROUP]
        if (names == "").any():
            raise ValueError(f"{whole.where(int((names == '').argmax()))}: the group is not named")
        self._check_runs(whole)
        parts = {
            str(name): self.of_table(
                given, whole.rows(np.flatnonzero(names == name)).without(GROUP), observations or {}
            )
            for name in dict.fromkeys(names.tolist())
        }
        return JointLikelihood(parts, own)

    @staticmethod
    def _check_runs(table: Table) -> None:
        """ValueError for a run in two groups."""
        of: dict[str, str] = {}
        for row, run in enumerate(table.columns.get("run", ())):
            if of.setdefault(run, table.columns[GROUP][row]) != table.columns[GROUP][row]:
                raise ValueError(f"{table.where(row)}: this run is in group {of[run]!r} above; a run has one group")
