"""The channels of a network as rows of text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.reading import shortened
from kinetics.network.reactions import sides_of
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats


def reaction_texts(species: Sequence[str], reactants: SparseTable, stoichiometry: SparseTable) -> list[str]:
    """Each reaction as in `A + 2 B -> C`; 0 stands for nothing."""
    texts = []
    for r in range(reactants.shape[0]):
        before, after = sides_of(reactants, stoichiometry, r)
        texts.append(f"{_side(species, before)} -> {_side(species, after)}")
    return texts


def _side(species: Sequence[str], copies: Mapping[int, int]) -> str:
    return " + ".join(species[s] if n == 1 else f"{n} {species[s]}" for s, n in copies.items()) or "0"


def rows_of(
    channels: Sequence[str],
    reactions: Sequence[str],
    ways: Floats,
    rate_constants: Floats | None,
    laws: Mapping[str, Expression],
    formulas: Mapping[str, Expression],
) -> list[tuple[str, ...]]:
    """Name, reaction and ways of every channel, and its rate constant, as a formula too, or law if it is known."""
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
