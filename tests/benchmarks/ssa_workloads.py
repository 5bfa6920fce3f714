"""Networks on which exact sampling is timed; each is made with its initial state and a time until which to run."""

from __future__ import annotations

import numpy as np

from kinetics.network import Network
from kinetics.network.sparse_tables import SparseTable

Workload = tuple[Network, np.ndarray, float]


def paper_line(cubes: int) -> Workload:
    """The paper's line; joins slowed down so that all tanks fill at the same pace. 44 events from 60 cubes."""
    from kinetics import Rates
    from kinetics.assembly import RuleBook, derive

    line = Rates.load("table3").apply(derive(RuleBook.load("line4")).network)
    is_join = np.bincount(line.sparse_reactants.rows, line.sparse_reactants.copies) == 2
    model = line.with_rates(line.rate_constants * np.where(is_join, 60 / cubes, 1.0))
    return model, model.state({"monomer": cubes}), 2000.0


def polymer(longest: int = 100, monomers: int = 5000) -> Workload:
    """Every pair of chains joins up to a length, every bond breaks: `longest`**2 / 2 channels on few species."""
    pairs = [(i, j) for i in range(1, longest) for j in range(i, longest + 1 - i)]
    before = np.array([(i - 1, j - 1) for i, j in pairs])
    after = np.array([i + j - 1 for i, j in pairs])
    joins = np.arange(len(pairs))
    breaks = joins + len(pairs)
    shape = (2 * len(pairs), longest)
    ones = np.ones(len(pairs), dtype=np.int64)
    columns = np.concatenate([before[:, 0], before[:, 1], after])
    rows = np.concatenate([joins, joins, breaks])
    rates = np.where(np.arange(shape[0]) < len(pairs), 1e-3, 0.1)
    names = [f"{i}+{j}" for i, j in pairs] + [f"{i}|{j}" for i, j in pairs]
    net = Network(
        [f"chain{i}" for i in range(1, longest + 1)],
        names,
        SparseTable.of_entries(shape, rows, columns, np.concatenate([ones, ones, ones])),
        SparseTable.of_entries(
            shape,
            np.concatenate([joins, joins, joins, breaks, breaks, breaks]),
            np.concatenate([before[:, 0], before[:, 1], after] * 2),
            np.concatenate([-ones, -ones, ones, ones, ones, -ones]),
        ),
        np.ones(shape[0]),
        rates,
    )
    return net, net.state({"chain1": monomers}), 2.0


def tanks_in_a_row(n_tanks: int, monomers: int = 60, hops: float = 0.5, pace: float = 100.0) -> Workload:
    """The paper's line in each of a row of tanks, monomers hopping to the neighbours: 10 channels a tank."""
    line, _, _ = paper_line(60)
    size = len(line.species)
    tank = np.arange(n_tanks)

    def repeated(terms: SparseTable) -> list[np.ndarray]:
        shift = np.repeat(tank, terms.rows.size)
        return [
            np.tile(terms.rows, n_tanks) + shift * len(line.channels),
            np.tile(terms.columns, n_tanks) + shift * size,
            np.tile(terms.copies, n_tanks),
        ]

    sources = np.concatenate([tank[:-1], tank[1:]]) * size
    targets = np.concatenate([tank[1:], tank[:-1]]) * size
    hop = np.arange(sources.size) + n_tanks * len(line.channels)
    ones = np.ones(hop.size, dtype=np.int64)
    shape = (n_tanks * len(line.channels) + hop.size, n_tanks * size)
    needed = [np.concatenate(p) for p in zip(repeated(line.sparse_reactants), (hop, sources, ones), strict=True)]
    gained = zip(repeated(line.sparse_stoichiometry), (hop, sources, -ones), (hop, targets, ones), strict=True)
    net = Network(
        [f"{name}@{i}" for i in tank for name in line.species],
        [f"{name}@{i}" for i in tank for name in line.channels]
        + [f"{a}>{b}" for a, b in zip(sources, targets, strict=True)],
        SparseTable.of_entries(shape, *needed),
        SparseTable.of_entries(shape, *(np.concatenate(p) for p in gained)),
        np.concatenate([np.tile(line.ways, n_tanks), ones]),
        np.concatenate([np.tile(line.rate_constants * pace, n_tanks), hops * ones]),
    )
    start = np.zeros(shape[1], dtype=np.int64)
    start[::size] = monomers
    return net, start, 1.0


def ring(n_species: int, copies: int = 100) -> Workload:
    """Copies that walk both ways around a ring of species: 2 channels a species."""
    names = [f"place{i}" for i in range(n_species)]
    reactions = {
        f"{i}>{j}": ({names[i]: 1}, {names[j]: 1})
        for i in range(n_species)
        for j in ((i + 1) % n_species, (i - 1) % n_species)
    }
    net = Network.from_reactions(reactions, np.ones(len(reactions)), species=names)
    return net, np.full(n_species, copies), 10.0 / n_species
