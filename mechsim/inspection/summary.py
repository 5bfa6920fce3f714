"""Tables and plots of the counts in a run: by species where few occurred, else by structure size."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.runs import JumpPath
from kinetics.support import plots
from kinetics.support.tables import text_table
from mechsim.runs.record import RunRecord, book_of
from mechsim.runs.species import species_of

MOST_COLUMNS = 8  # of counts
GRID = 401  # points of a plotted curve

Columns = dict[str, NDArray[np.bool_]]


def target_of(record: RunRecord) -> str | None:
    """Species of the finished structure, if the run's book names one that free cubes can become."""
    derivation = book_of(record.spec.scene.rules)[1]
    return species_of(derivation, derivation.book.target)


def columns_of(network: Network, paths: Sequence[JumpPath], target: str | None) -> Columns:
    """Columns of a table of counts: title -> the species (S,) that it counts.

    A column for each species that ever was in one of the runs, and for the target; where these are more than eight,
    for each size; where these too are more than eight, for 1 cube, 2, 3 to 4, 5 to 8 and on.
    """
    occurred = np.any([(path.states > 0).any(axis=0) for path in paths], axis=0)
    if target is not None:
        occurred[network.index(target)] = True
    if occurred.sum() <= MOST_COLUMNS:
        return {network.species[s]: np.arange(occurred.size) == s for s in np.flatnonzero(occurred)}
    sizes = network.conserved["cubes"].astype(int)
    present = np.unique(sizes[occurred]).tolist()
    ends = present
    if len(present) > MOST_COLUMNS:
        powers = [2**k for k in range(present[-1].bit_length() + 1)]
        ends = [top for top in powers if any(top // 2 < size <= top for size in present)]
    found: Columns = {}
    for top in ends:
        low = top if ends is present else top // 2 + 1
        title = f"{low}-{top} cubes" if low < top else f"{top} cube{'s' if top > 1 else ''}"
        found[title] = (low <= sizes) & (sizes <= top)
    return found


def row(record: RunRecord) -> dict[str, Any]:
    """One run for programs: what is not named in `events` did not fire, what is not in `final` was not there.

    largest : cubes in the largest structure at the end; target, first_target : copies at the end and time of the first
        one, tu; None where there was none, or the book names no target
    """
    path, target = record.path, target_of(record)
    network, final = path.network, path.states[-1]
    fired = Counter(path.channels[path.channels >= 0].tolist())
    first = np.nan if target is None else path.first_time(target)
    return {
        "run": record.spec.run,
        "key": record.spec.key,
        "outcome": record.outcome,
        "end": path.end,
        "events": {network.channels[c]: fired[c] for c in sorted(fired)},
        "final": {network.species[s]: int(final[s]) for s in np.flatnonzero(final)},
        "largest": int(network.conserved["cubes"][final > 0].max()),
        "target": None if target is None else int(final[network.index(target)]),
        "first_target": float(first) if np.isfinite(first) else None,
        "digest": record.digest,
        **record.cost,
    }


def table(records: Sequence[RunRecord]) -> str:
    """One line per run, for people."""
    target = target_of(records[0])
    columns = columns_of(records[0].path.network, [record.path for record in records], target)
    lines = []
    for record in records:
        shown, final = row(record), record.path.states[-1]
        line = {"run": shown["run"]} | {title: final[counted].sum() for title, counted in columns.items()}
        line["largest"] = shown["largest"]
        if target is not None:
            first = shown["first_target"]
            line |= {target: shown["target"], f"first {target} (tu)": "-" if first is None else f"{first:.1f}"}
        line["events"] = sum(shown["events"].values())
        lines.append(line | {"CPU (s)": f"{shown['cpu_seconds']:.1f}", "outcome": shown["outcome"]})
    return text_table(tuple(lines[0]), [tuple(str(cell) for cell in line.values()) for line in lines])


def plot_counts(ax: Any, records: Sequence[RunRecord]) -> Any:
    """Mean counts over time with the band that holds the middle 95 % of runs, in the table's columns; returns `ax`."""
    paths = [record.path for record in records]
    columns = columns_of(paths[0].network, paths, target_of(records[0]))
    grid = np.linspace(0.0, min(path.end for path in paths), GRID)
    counts = np.stack([np.stack([path.at(grid)[:, s].sum(axis=1) for s in columns.values()], axis=1) for path in paths])
    low, high = (np.quantile(counts.astype(float), q, axis=0, method="inverted_cdf") for q in (0.025, 0.975))
    return plots.bands(ax, grid, counts.mean(axis=0), low, high, list(columns))
