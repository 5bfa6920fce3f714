"""Reactions as two sides, `({"A": 1, "B": 1}, {"AB": 1})`, and as sparse tables, with conversion both ways."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinetics.network.checks import checked_names, some_names
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import integers

Reaction = tuple[Mapping[str, int], Mapping[str, int]]  # copies needed and copies made, by species


def reaction_tables(
    reactions: Mapping[str, Reaction], species: Sequence[str] | None
) -> tuple[tuple[str, ...], SparseTable, SparseTable]:
    """The species, and of each channel the reactants and the net change (R, S).

    species : their order; None for that in which the reactions name them
    """
    if not isinstance(reactions, Mapping):
        raise ValueError(
            f"reactions are {reactions!r}; expected channel -> reaction, as in {{'r': ({{'A': 1}}, {{'B': 1}})}}; "
            "Network.from_text reads reactions as text"
        )
    for name, pair in reactions.items():
        if not (isinstance(pair, Sequence) and len(pair) == 2 and all(isinstance(side, Mapping) for side in pair)):
            raise ValueError(
                f"reaction {name!r} is {pair!r}; expected copies needed and made, as in ({{'A': 1}}, {{'B': 1}}); "
                "Network.from_text reads reactions as text"
            )
    sides = [(r, side, made) for r, pair in enumerate(reactions.values()) for made, side in enumerate(pair)]
    in_order = dict.fromkeys(name for _, side, _ in sides for name in side)
    named = checked_names("species", tuple(in_order) if species is None else species)
    place = {name: s for s, name in enumerate(named)}
    entries = [(r, name, n, made) for r, side, made in sides for name, n in side.items()]
    unknown = [name for _, name, _, _ in entries if name not in place]
    if unknown:
        raise ValueError(f"unknown species {unknown[0]!r}; the network has {some_names(named)}")
    rows = np.array([r for r, _, _, _ in entries], dtype=np.int64)
    columns = np.array([place[name] for _, name, _, _ in entries], dtype=np.int64)
    copies = integers("copies", [n for _, _, n, _ in entries], (None,), minimum=0)
    is_made = np.array([made for _, _, _, made in entries], dtype=bool)
    shape = (len(reactions), len(place))
    reactants = SparseTable.of_entries(shape, rows[~is_made], columns[~is_made], copies[~is_made])
    return named, reactants, SparseTable.of_entries(shape, rows, columns, np.where(is_made, copies, -copies))


def sides_of(reactants: SparseTable, change: SparseTable, r: int) -> tuple[dict[int, int], dict[int, int]]:
    """Copies needed and copies made in channel r, each by species number; none of them 0."""
    before = dict(zip(*(part.tolist() for part in reactants.row(r)), strict=True))
    gained = dict(zip(*(part.tolist() for part in change.row(r)), strict=True))
    after = {s: before.get(s, 0) + gained.get(s, 0) for s in sorted(before | gained)}
    return before, {s: copies for s, copies in after.items() if copies}
