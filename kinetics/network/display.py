"""The display of a network as text or HTML: a headline, a table of its channels, its events."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.reading import shortened
from kinetics.network.reactions import sides_of
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats
from kinetics.support.tables import text_table


@dataclass(frozen=True)
class NetworkTable:
    """Headline, titles and rows of text, with one row per channel and one line per event."""

    headline: str
    titles: Sequence[str]
    rows: Sequence[Sequence[str]]
    events: Sequence[str]

    @property
    def text(self) -> str:
        """Aligned columns for a terminal."""
        return "\n".join([self.headline, text_table(self.titles, self.rows), *self.events])

    @property
    def html(self) -> str:
        """A table for a notebook; names are escaped."""
        lines = ["".join(f"<th>{title}</th>" for title in self.titles)]
        lines += ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in self.rows]
        table = "".join(f"<tr>{line}</tr>" for line in lines)
        events = "".join(f"<p>{html.escape(event)}</p>" for event in self.events)
        return f"<p>{html.escape(self.headline)}</p><table>{table}</table>{events}"


def reaction_texts(species: Sequence[str], reactants: SparseTable, stoichiometry: SparseTable) -> list[str]:
    """Each reaction as in `A + 2 B -> C`; 0 stands for nothing."""
    texts = []
    for r in range(reactants.shape[0]):
        before, after = sides_of(reactants, stoichiometry, r)
        texts.append(f"{_side(species, before)} -> {_side(species, after)}")
    return texts


def _side(species: Sequence[str], copies: Mapping[int, int]) -> str:
    return " + ".join(species[s] if n == 1 else f"{n} {species[s]}" for s, n in copies.items()) or "0"


def channel_rows(
    channels: Sequence[str],
    reactions: Sequence[str],
    ways: Floats,
    rate_constants: Floats | None,
    laws: Mapping[str, Expression],
    formulas: Mapping[str, Expression],
) -> list[tuple[str, ...]]:
    """Name, reaction and ways of every channel, and its rate constant, as a formula too, or law where it is known."""
    rows = []
    for r, (name, reaction) in enumerate(zip(channels, reactions, strict=True)):
        rate: tuple[str, ...] = () if rate_constants is None else (f"{rate_constants[r]:.4g}",)
        if name in formulas:
            rate = (f"{shortened(formulas[name].text)} = {rate[0]}",)
        if name in laws:
            factor = "" if rate in ((), ("1",)) else f"{rate[0]} * "
            rate = (f"{factor}[{laws[name]}]",)
        rows.append((name, reaction, f"{ways[r]:g}", *rate))
    width = max(map(len, rows), default=0)
    return [(*row, *[""] * (width - len(row))) for row in rows]
