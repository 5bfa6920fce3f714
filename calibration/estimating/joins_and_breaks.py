"""The two groups of channels by which runs are judged as wholes: all joins and all breaks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.network.sparse_tables import SparseTable
from kinetics.rates.breaks import is_break
from kinetics.support.arrays import Floats

JOINS, BREAKS = "joins", "breaks"
WHOLES = (JOINS, BREAKS)


def joins_and_breaks(network: Network) -> dict[str, NDArray[np.bool_]]:
    """Channels (R,) bool of `joins`, in which two bodies become fewer, and of `breaks`, as break models see them.

    A group without channels is left out, and a channel of neither, such as a conversion, is in none.
    """
    joins = (_totals(network.sparse_reactants) == 2) & (_totals(network.sparse_stoichiometry) < 0)
    groups = {JOINS: joins, BREAKS: is_break(network)}
    return {name: members for name, members in groups.items() if members.any()}


def _totals(table: SparseTable) -> Floats:
    """Copies (R,) in each row."""
    return np.bincount(table.rows, table.copies, table.shape[0]).astype(float)
