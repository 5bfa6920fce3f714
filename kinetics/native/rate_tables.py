"""Square sparse tables by rows, and the classes of states that lead to each other: in C, else by numpy and SciPy.

Importing `scipy.sparse` takes as long as numpy itself. What a question about a small chain needs of it is here.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.native.library import call, given, is_built
from kinetics.support.packages import sparse

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class RateTable(NamedTuple):
    """A sparse table (n, n) by rows, with rising columns in each and one entry a place.

    indptr : (n + 1,) where each row begins; indices : (K,) columns; data : (K,) values, as `scipy.sparse` names them

    >>> table = RateTable.of(np.array([1, 0, 1]), np.array([0, 1, 0]), np.array([2.0, 3.0, 0.5]), 2)
    >>> table.toarray().tolist(), table.transposed().toarray().tolist()
    ([[0.0, 3.0], [2.5, 0.0]], [[0.0, 2.5], [3.0, 0.0]])
    """

    indptr: Ints
    indices: Ints
    data: Floats

    @classmethod
    def of(cls, rows: NDArray[Any], columns: NDArray[Any], values: Floats, n: int) -> RateTable:
        """The table of values (K,) at rows and columns (K,), each from 0 to n - 1; those of one place add up."""
        here, there, size = given(rows, np.int64), given(columns, np.int64), len(rows)
        begins, places, found = np.empty(n + 1, np.int64), np.empty(size, np.int64), np.empty(size)
        if is_built():
            room = np.empty(size + n + 1, np.int64)
            kept = call("rows_of", here, there, given(values, float), size, n, begins, places, found, room)
            return cls(begins, places[:kept], found[:kept])

        order = np.lexsort((there, here))  # stable, so that values of one place add up as they came
        here, there = here[order], there[order]
        is_first = np.append(True, (np.diff(here) != 0) | (np.diff(there) != 0))[:size]
        found = np.zeros(int(np.count_nonzero(is_first)))
        np.add.at(found, np.cumsum(is_first) - 1, given(values, float)[order])
        return cls(np.searchsorted(here[is_first], np.arange(n + 1)), there[is_first], found)

    @property
    def nnz(self) -> int:
        """How many places have an entry."""
        return self.data.size

    @property
    def rows(self) -> Ints:
        """The row (K,) of each entry."""
        return np.repeat(np.arange(self.indptr.size - 1), np.diff(self.indptr))

    def transposed(self) -> RateTable:
        """The table with rows and columns exchanged."""
        return self.of(self.indices, self.rows, self.data, self.indptr.size - 1)

    def toarray(self) -> Floats:
        """The dense table (n, n)."""
        n = self.indptr.size - 1
        found = np.zeros((n, n))
        found[self.rows, self.indices] = self.data
        return found


def connected_classes(rows: NDArray[Any], columns: NDArray[Any], n: int) -> tuple[int, Ints]:
    """How many classes of states there are that lead to each other and back, and the class (n,) of each state.

    rows, columns : (K,) a way from each row to its column. Classes are numbered by their first states. Linear in K + n.

    >>> connected_classes(np.array([0, 1, 2]), np.array([1, 0, 1]), 3)
    (2, array([0, 0, 1]))
    """
    if is_built():
        ways, label = RateTable.of(rows, columns, np.zeros(len(rows)), n), np.empty(n, np.int64)
        return int(call("components", ways.indptr, ways.indices, n, label, np.empty(5 * n, np.int64))), label

    graph: Any = sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    found, classes = sparse.csgraph.connected_components(graph, directed=True, connection="strong")
    _, first, which = np.unique(classes, return_index=True, return_inverse=True)
    return int(found), np.argsort(np.argsort(first)).astype(np.int64)[which]
