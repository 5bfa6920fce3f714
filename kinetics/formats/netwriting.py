"""The writer of .net files."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np

from kinetics.network import Model, Network
from kinetics.network.checks import spelled_apart
from kinetics.network.sparse_tables import SparseTable

PATTERN = re.compile(r"[A-Za-z_]\w*\([^\s#$]*\)(\.[A-Za-z_]\w*\([^\s#$]*\))*")


def net_text(model: Model) -> str:
    """The .net file of a model.

    Names that the format cannot have are spelled with _ for the characters in question. ValueError if like
    reactants are counted as products.
    """
    network = model.network
    if not network.is_mass_action:
        what = f"law of channel {next(iter(network.laws))!r}" if network.laws else f"event {network.events[0].name!r}"
        raise ValueError(f"a .net file is written for mass action alone; the {what} does not fit")
    ways = _ways(network)
    constants, which = np.unique(network.known_rates, return_inverse=True)
    needs = _sides(network.sparse_reactants)
    made = SparseTable.of_entries(
        network.sparse_stoichiometry.shape,
        np.concatenate([network.sparse_reactants.rows, network.sparse_stoichiometry.rows]),
        np.concatenate([network.sparse_reactants.columns, network.sparse_stoichiometry.columns]),
        np.concatenate([network.sparse_reactants.copies, network.sparse_stoichiometry.copies]),
    )
    reactions = zip(needs, _sides(made), ways.tolist(), which.tolist(), network.channels, strict=True)
    patterns = _patterns(network.species)
    place = {name: str(s) for s, name in enumerate(network.species, 1)}
    lines = ["begin parameters"]
    lines += [f"{i} k{i} {constant!r}" for i, constant in enumerate(constants.tolist(), 1)]
    lines += ["end parameters", "begin species"]
    lines += [
        f"{s} {pattern} {count}" for s, (pattern, count) in enumerate(zip(patterns, model.initial, strict=True), 1)
    ]
    lines += ["end species", "begin reactions"]
    lines += [
        f"{r} {before} {after} {'' if n == 1 else f'{n!r}*'}k{k + 1} #{_one_line(name)}"
        for r, (before, after, n, k, name) in enumerate(reactions, 1)
    ]
    lines.append("end reactions")
    if model.observables:
        lines.append("begin groups")
        names = spelled_apart(list(model.observables), _word, taken=[f"k{i + 1}" for i in range(constants.size)])
        for g, (name, weights) in enumerate(zip(names, model.observables.values(), strict=True), 1):
            terms = [place[each] if w == 1 else f"{w:.17g}*{place[each]}" for each, w in weights.items()]
            lines.append(f"{g} {name} {','.join(terms)}".rstrip())
        lines.append("end groups")
    return "\n".join(lines) + "\n"


def _ways(network: Network) -> np.ndarray:
    """Ways (R,) of each channel as the format has them: it counts every order of like reactants."""
    needed = network.sparse_reactants
    if network.combinations == "ordered" or not np.any(needed.copies > 1):
        return network.ways
    if network.combinations == "product":
        raise ValueError(
            "a .net file counts pairs of one species as n (n - 1); it cannot express `product` combinations, which "
            "count n squared"
        )
    orders = np.ones(len(network.channels))
    with np.errstate(over="ignore"):
        factorials = np.cumprod(np.concatenate([[1.0], np.arange(1.0, needed.copies.max() + 1)]))
        np.multiply.at(orders, needed.rows, factorials[needed.copies])
    ways = network.ways / orders
    lost = np.flatnonzero((network.ways > 0) & (ways < np.finfo(np.float64).tiny))
    if lost.size:
        raise ValueError(
            f"channel {network.channels[lost[0]]!r} needs so many copies of one species that its multiplicity over "
            f"their orders is too small for a float; write the reaction in steps of fewer reactants"
        )
    return ways


def _sides(table: SparseTable) -> list[str]:
    """Numbers of the species on one side of each reaction, a species of two copies twice; 0 for none."""
    copies, columns, starts = table.copies.tolist(), table.columns.tolist(), table.starts.tolist()
    return [
        ",".join(",".join([str(columns[i] + 1)] * copies[i]) for i in range(begin, end)) or "0"
        for begin, end in pairwise(starts)
    ]


def _patterns(species: tuple[str, ...]) -> list[str]:
    """Names as the format has them: `A()` for a plain name, and sites in brackets as they are."""

    def spelled(name: str) -> str:
        return name.removesuffix("()") if PATTERN.fullmatch(name) else _word(name)

    return [name if PATTERN.fullmatch(name) else f"{name}()" for name in spelled_apart(species, spelled)]


def _word(name: str) -> str:
    word = re.sub(r"\W", "_", name)
    return word if re.match(r"[A-Za-z_]", word) else f"_{word}"


def _one_line(text: str) -> str:
    return " ".join(text.split())
