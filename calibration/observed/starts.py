"""The states in which runs that others recorded may start, and how probable each is."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from calibration.observed.tables import Table, near, read_table
from kinetics.network import Model
from kinetics.support.arrays import Floats, Ints

PROBABILITY = "probability"
MOST_OFF = 1e-6  # by which probabilities in a table may differ from 1 together, as those of few digits do


class StartDistribution(NamedTuple):
    """States (M, S), and their probabilities (M,), which sum to 1."""

    states: Ints
    chances: Floats

    @classmethod
    def certain(cls, initial: Ints) -> StartDistribution:
        """One state (S,)."""
        return cls(initial[None, :], np.ones(1))


def read_starts(model: Model, path: str | Path | Table) -> StartDistribution:
    """The states in which a run may start, from a table with a row for each.

    path : table (CSV or Parquet) with the column `probability`, and one for each species whose count it says; the
        others start as in the model

    ValueError: a table that cannot be read, an unknown species, a state twice, or probabilities that do not sum to 1

    >>> import numpy as np
    >>> from calibration.observed.starts import read_starts
    >>> from calibration.observed.tables import Table
    >>> from kinetics import Model, Network
    >>> cells = {"B": np.array(["0", "1"], dtype=object), "probability": np.array([".25", ".75"], dtype=object)}
    >>> found = read_starts(Model(Network.from_text("A -> B, 1"), {"A": 3}), Table("t.csv", cells, np.arange(2, 4)))
    >>> found.states.tolist(), found.chances.tolist()
    ([[3, 0], [3, 1]], [0.25, 0.75])
    """
    table = read_table(path)
    table.require(PROBABILITY)
    titles = [title for title in table.columns if title != PROBABILITY]
    places = model.network.species_places
    for title in titles:
        if title not in places:
            raise ValueError(f"{table.name}: column {title!r} is no species{near(title, list(places))}")
    rows = np.arange(len(table))
    chances = table.numbers(PROBABILITY, rows)
    if (chances < 0.0).any():
        raise ValueError(f"{table.where(int((chances < 0.0).argmax()))}: a probability below 0")
    if not abs(chances.sum() - 1.0) <= MOST_OFF:
        raise ValueError(f"{table.name}: the probabilities sum to {chances.sum():.9g}; expected 1")
    states = np.tile(np.array(model.initial), (rows.size, 1))
    counts = table.counts(titles, rows)
    if np.isnan(counts).any():
        row, column = np.argwhere(np.isnan(counts))[0].tolist()
        raise ValueError(f"{table.where(row)}: {titles[column]} is empty; expected a number")
    for column, title in enumerate(titles):
        states[:, places[title]] = counts[:, column].astype(np.int64)
    different, first = np.unique(states, axis=0, return_index=True)
    if len(different) < rows.size:
        again = min(set(rows.tolist()) - set(first.tolist()))
        raise ValueError(f"{table.where(again)}: a state that stands above, too; give each once")
    kept = chances > 0.0
    return StartDistribution(states[kept], chances[kept] / chances.sum())
