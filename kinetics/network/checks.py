"""Checks of a network: unique names, tables of matching shapes, non-negative counts, conserved quantities."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats, integers, reals


def checked_names(what: str, names: Sequence[str]) -> tuple[str, ...]:
    """The names as a tuple. ValueError if one is empty or repeated."""
    if isinstance(names, str):
        raise ValueError(f"{what} = {names!r}; expected a sequence of names")
    checked = tuple(names)
    if not all(isinstance(name, str) and name for name in checked):
        raise ValueError(f"{what} must be non-empty names; {checked} came")
    if len(set(checked)) < len(checked):
        doubled = {name for name, count in Counter(checked).items() if count > 1}
        raise ValueError(f"{what} has {min(doubled)!r} twice; names must be unique")
    return checked


def checked_choice(what: str, value: str, choices: Sequence[str]) -> str:
    """The value, one of some."""
    if value not in choices:
        raise ValueError(f"{what} = {value!r}; expected one of {', '.join(choices)}")
    return value


def checked_table(
    name: str, table: SparseTable | ArrayLike, shape: tuple[int, int], minimum: int | None = None
) -> SparseTable:
    """A sparse table of this shape (channels, species), also from a dense one; [] stands for one without rows."""
    if not isinstance(table, SparseTable):
        is_empty = shape[0] == 0 and np.size(table) == 0
        dense = integers(name, np.zeros(shape, dtype=np.int64) if is_empty else table, shape, minimum)
        return SparseTable.of_dense(dense)
    if table.shape != shape:
        raise ValueError(f"{name} has shape {table.shape}; expected {shape}")
    if minimum is not None and table.copies.size and table.copies.min() < minimum:
        raise ValueError(f"{name} holds {table.copies.min()}; expected at least {minimum}")
    return table


def check_no_overdraft(
    species: Sequence[str], channels: Sequence[str], reactants: SparseTable, change: SparseTable
) -> None:
    """ValueError if a channel takes more copies than it needs: it could make a count negative."""
    short = np.flatnonzero(reactants.at(change.keys) + change.copies < 0)
    if short.size:
        r, s = change.rows[short[0]], change.columns[short[0]]
        raise ValueError(
            f"channel {channels[r]!r} takes {-change.copies[short[0]]} of {species[s]!r} but needs only "
            f"{reactants.at(change.keys[short[:1]])[0]}; raise its reactants"
        )


def checked_conserved(
    conserved: Mapping[str, ArrayLike], channels: Sequence[str], change: SparseTable
) -> dict[str, Floats]:
    """Amounts (S,) of each conserved quantity in one copy of each species; ValueError if a channel changes it."""
    amounts = {}
    for name, given in conserved.items():
        amounts[name] = reals(f"conserved {name!r}", given, (change.n_columns,))
        gains = change.copies * amounts[name][change.columns]
        net = np.bincount(change.rows, gains, len(channels))
        scale = np.bincount(change.rows, np.abs(gains), len(channels))
        broken = np.flatnonzero(np.abs(net) > 1e-12 * scale)
        if broken.size:
            raise ValueError(
                f"channel {channels[broken[0]]!r} changes the conserved quantity {name!r} by {net[broken[0]]:g}; "
                f"correct the channel or the weights"
            )
    return amounts


def spelled_apart(names: Sequence[str], spell: Callable[[str], str], taken: Collection[str] = ()) -> list[str]:
    """Names respelled for another program and kept distinct by appending _.

    spell : a name -> what it becomes; a name that stays what it is goes before those that would become the same
    taken : spellings that none may have

    >>> spelled_apart(["A-B", "A_B", "A B"], lambda name: name.replace("-", "_").replace(" ", "_"))
    ['A_B_', 'A_B', 'A_B__']
    """
    own = {name for name in names if spell(name) == name} - {*taken}
    used, made = {*own, *taken}, []
    for name in names:
        text = spell(name)
        if name in own:
            own.discard(name)  # of two that are the same, the first
        else:
            while text in used:
                text += "_"
        used.add(text)
        made.append(text)
    return made


def some_names(names: Collection[str]) -> str:
    """The first dozen of the names, and how many more there are."""
    shown = list(names)[:12]
    return ", ".join(shown) + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def nearest(name: str, known: Collection[str]) -> str:
    """Suggestions for an unknown name: similar names, or else some of the existing ones."""
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.4)
    return f"did you mean {' or '.join(near)}?" if near else f"there are {some_names(known)}"
