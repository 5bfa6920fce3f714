"""Sparse tables of whole numbers, in compressed rows: reactants and stoichiometry of very many channels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.support.arrays import Ints, integers, read_only

MAX_BYTES = 2**31  # of a dense table


@dataclass(frozen=True, eq=False)
class SparseTable:
    """The entries other than 0 of a table (rows, columns), in the order of rows, then columns.

    starts : (rows + 1,) row i has the entries starts[i] to starts[i + 1]
    columns, copies : (entries,)
    n_columns : width of the table

    Of a network's `sparse_reactants` and `sparse_stoichiometry` the rows are channels and the columns species.
    """

    starts: Ints
    columns: Ints
    copies: Ints
    n_columns: int

    @classmethod
    def of_dense(cls, table: Ints) -> SparseTable:
        """The entries of a dense table (rows, columns)."""
        rows, columns = np.nonzero(table)
        return cls._sorted(table.shape, rows, columns, table[rows, columns])

    @classmethod
    def of_entries(cls, shape: tuple[int, int], rows: ArrayLike, columns: ArrayLike, copies: ArrayLike) -> SparseTable:
        """Entries in any order; those of one place are added up."""
        given = integers("copies", copies, (None,))
        places = []
        for name, values, length in (("rows", rows, shape[0]), ("columns", columns, shape[1])):
            place = integers(name, values, given.shape, minimum=0)
            if place.size and place.max() >= length:
                raise ValueError(f"{name} holds {place.max()}; the table has only {length}")
            places.append(place)
        keys: Ints = places[0] * shape[1] + places[1]
        order = np.argsort(keys, kind="stable")
        firsts = np.flatnonzero(np.diff(keys[order], prepend=-1))
        keys, total = keys[order][firsts], np.add.reduceat(given[order], firsts)
        keys, total = keys[total != 0], total[total != 0]
        return cls._sorted(shape, *np.divmod(keys, shape[1]), total)

    @classmethod
    def _sorted(cls, shape: tuple[int, ...], rows: Ints, columns: Ints, copies: Ints) -> SparseTable:
        starts = np.searchsorted(rows, np.arange(shape[0] + 1))
        parts = [read_only(part.astype(np.int64)) for part in (starts, columns, copies)]
        return cls(parts[0], parts[1], parts[2], shape[1])

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the table."""
        return self.starts.size - 1, self.n_columns

    @cached_property
    def rows(self) -> Ints:
        """Row (entries,) of each entry."""
        return read_only(np.repeat(np.arange(self.starts.size - 1), np.diff(self.starts)))

    @cached_property
    def keys(self) -> Ints:
        """Place (entries,) of each entry in the flattened table; rising."""
        return read_only(self.rows * self.n_columns + self.columns)

    def row(self, i: int) -> tuple[Ints, Ints]:
        """Columns and copies of one row."""
        part = slice(self.starts[i], self.starts[i + 1])
        return self.columns[part], self.copies[part]

    def entries_of(self, rows: Ints) -> tuple[Ints, Ints]:
        """All entries of the rows asked for: which of `rows` each belongs to, and which entry it is."""
        lengths = np.diff(self.starts)[rows]
        owner = np.repeat(np.arange(rows.size), lengths)
        within = np.arange(owner.size) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        return owner, self.starts[rows][owner] + within

    @property
    def has_entries(self) -> NDArray[np.bool_]:
        """Whether each row (rows,) holds anything but 0."""
        return np.diff(self.starts) > 0

    def picked(self, rows: Ints) -> SparseTable:
        """The table of these rows alone."""
        owner, entries = self.entries_of(rows)
        return SparseTable._sorted((rows.size, self.n_columns), owner, self.columns[entries], self.copies[entries])

    def added_to(self, counts: Ints, rows: Ints) -> Ints:
        """Counts (n, columns), each with one of the rows (n,) added."""
        total = counts.copy()
        owner, entries = self.entries_of(rows)
        total[owner, self.columns[entries]] += self.copies[entries]  # no place occurs twice
        return total

    def at(self, keys: Ints) -> Ints:
        """Values at places of the flattened table."""
        if not self.keys.size:
            return np.zeros(keys.shape, dtype=np.int64)
        near = np.minimum(np.searchsorted(self.keys, keys), self.keys.size - 1)
        return np.where(self.keys[near] == keys, self.copies[near], 0)

    def dense(self) -> Ints:
        """The dense table (rows, columns), closed for writing."""
        size = 8 * self.shape[0] * self.shape[1]
        if size > MAX_BYTES:
            raise ValueError(
                f"{self.shape[0]} channels by {self.shape[1]} species as a dense table need {size / 2**30:.1f} GB; "
                f"read the network's sparse_reactants and sparse_stoichiometry, which hold only what is not 0"
            )
        table = np.zeros(self.shape, dtype=np.int64)
        table[self.rows, self.columns] = self.copies
        return read_only(table)
