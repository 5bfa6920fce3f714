"""Networks of complexes of 1 to 12 faces, and the frames of another group's simulator as panel data for them.

Each frame is a run of its own: it starts from the counts of the frame before and is looked at once, 1 ms later. With
all counts known the likelihood of a run is the product over its frames, and frames that are alike are solved once.

In principle any number of breaks and new joins may hide between two frames, which makes millions of states. So the
species `broken` counts the breaks, and a frame is given the smallest number that explains its counts. The probability
is exact for the counts together with that number. The further columns are sums of f(size) that no join makes smaller
and that a break makes smaller by at most s, so that sum + s * broken never falls: a state in which one of them is
beyond its last value cannot lead to the frame. They follow from the counts and change no probability.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
from kinetics.network import Model, Network
from tests.results.nerdss_shapes import PAIRS, SIZES, Weights

Counts = tuple[int, ...]  # (12,) complexes of each size
FRAME = 1e-3  # s
MAX_STATES = 300_000  # between two frames
FREE_EDGES = (0, 5, 8, 9, 10, 11, 10, 11, 10, 9, 8, 5, 0)  # of the complexes with most bonds, by size


class Candidate(NamedTuple):
    """A model of the rates: formulas by (size, size), the smaller first, and where the parameters begin, 1/s."""

    join: Mapping[tuple[int, int], str]
    broken: Mapping[tuple[int, int], str]
    start: Mapping[str, float]

    @property
    def model(self) -> Model:
        """200 single faces, and a species that counts breaks."""
        lines = ["species: " + ", ".join([*(f"n{i}" for i in SIZES), "broken"])]
        lines += [f"join{i}_{j}: n{i} + n{j} -> n{i + j}, {self.join[i, j]}" for i, j in PAIRS]
        lines += [f"break{i}_{j}: n{i + j} -> n{i} + n{j} + broken, {self.broken[i, j]}" for i, j in PAIRS]
        return Model.of(Network.from_text("\n".join([*lines, "n1 = 200", "time unit: s"]), **self.start))


def candidates(weights: Weights) -> dict[str, Candidate]:
    """The models of the plan."""

    def group(size: int) -> str:
        return next(name for name, last in (("1", 1), ("2to4", 4), ("5to7", 7), ("8to11", 11)) if size <= last)

    dockings, held = ({pair: f"{table[pair]:.5f}" for pair in PAIRS} for table in weights)
    classes = {(i, j): f"k_{group(i)}_{group(j)}" for i, j in PAIRS}
    alike = {(i, j): f"b / {(i + j) // 2}" for i, j in PAIRS}
    three = {(i, j): "b_part" if i > 1 else "b_face_small" if i + j < 5 else "b_face_large" for i, j in PAIRS}
    parting = {"b_face_small": 0.3, "b_face_large": 0.1, "b_part": 0.03}
    docking = {pair: f"k * {ways}" for pair, ways in dockings.items()}
    return {
        "control": Candidate(dict.fromkeys(PAIRS, "k"), alike, {"k": 1.0, "b": 0.1}),
        "perimeter": Candidate(
            {(i, j): f"k * {FREE_EDGES[i] * FREE_EDGES[j]}" for i, j in PAIRS}, alike, {"k": 0.03, "b": 0.1}
        ),
        "docking": Candidate(docking, {pair: f"b * {bonds}" for pair, bonds in held.items()}, {"k": 0.03, "b": 1.0}),
        "docking3": Candidate(docking, three, {"k": 0.03, **parting}),
        "classes": Candidate(
            classes, three, {**{classes[pair]: 0.03 * weights.dockings[pair] for pair in PAIRS}, **parting}
        ),
        "dockclass": Candidate(
            {pair: f"{classes[pair]} * {dockings[pair]}" for pair in PAIRS},
            three,
            {**dict.fromkeys(classes.values(), 0.03), **parting},
        ),
    }


def _sums() -> list[tuple[np.ndarray, int]]:
    """f (12,) with f(i + j) >= f(i) + f(j), and the most by which the two differ."""
    i = np.arange(1, 13)
    above = [*(i * (i >= s) for s in range(2, 13)), *(i // s for s in range(2, 13))]
    above += [*(np.maximum(i - s, 0) for s in range(1, 12)), *(1 * (i >= s) for s in range(7, 13))]
    below = [*(1 * (i <= s) for s in range(1, 13)), *(-(-i // s) for s in range(2, 12))]
    below += [1 * (i % s > 0) for s in range(2, 12)]  # these have f(i + j) <= f(i) + f(j)
    every = {tuple(f.tolist()) for f in [*above, *(f.max() * i - f for f in below)]}
    return [(np.array(f), max(f[a + b - 1] - f[a - 1] - f[b - 1] for a, b in PAIRS)) for f in sorted(every)]


SUMS = _sums()
COLUMNS: dict[str, dict[str, float]] = {
    **{name: {name: 1.0} for name in (*(f"n{i}" for i in SIZES), "broken")},
    **{
        f"sum{place}": {**{f"n{i}": float(f[i - 1]) for i in SIZES if f[i - 1]}, "broken": float(most)}
        for place, (f, most) in enumerate(SUMS)
    },
}


def frame(before: Counts, after: Counts, n_breaks: int) -> PanelRun:
    """One frame as a run of its own."""
    sums = [f @ after + most * n_breaks for f, most in SUMS]
    return PanelRun(np.array([*before, 0]), np.array([FRAME]), np.array([[*after, n_breaks, *sums]], dtype=float))


def fewest_breaks(model: Model, before: Counts, after: Counts) -> int:
    """The smallest number of breaks from which a frame can come."""
    n_breaks = max(0, sum(after) - sum(before))
    while True:
        try:
            PanelLikelihood(model, PanelData(COLUMNS, [frame(before, after, n_breaks)]), MAX_STATES).value()
        except ValueError as error:
            if "cannot be reached" not in str(error):
                raise
            n_breaks += 1
        else:
            return n_breaks


def read_runs(path: Path) -> dict[int, np.ndarray]:
    """Counts (T, 12) of each run, at 0, 1, 2, ... ms."""
    table = pd.read_csv(path)
    sizes = [f"n{i}" for i in SIZES]
    return {int(run): rows.sort_values("time_s")[sizes].to_numpy() for run, rows in table.groupby("run")}


def panel_of(runs: Iterable[np.ndarray], model: Model) -> PanelData:
    """The frames of runs (T, 12), each with its fewest breaks by the channels of a model."""
    known: dict[tuple[Counts, Counts], PanelRun] = {}
    frames = []
    for counts in runs:
        rows = [tuple(row) for row in counts.tolist()]
        for pair in pairwise(rows):
            if pair not in known:
                known[pair] = frame(*pair, fewest_breaks(model, *pair))
            frames.append(known[pair])
    return PanelData(COLUMNS, frames)
