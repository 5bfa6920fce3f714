"""Records of network-free runs: every event, and counts, sizes and pictures of what grew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.assembly.faces import ROTATIONS, compose, scheme_of
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Placement, Structure
from kinetics.support import plots
from kinetics.support.arrays import Floats, Ints, integers, read_only, reals, rising_times
from kinetics.support.datasets import dataframe
from kinetics.support.frozen import set_fields
from kinetics.support.packages import pd
from kinetics.support.shown import MOST_TIMES, ResultTable, Shown, Tabular, on_axes, over_time

NOTHING = -1  # in `before` and `after` of an event that takes or makes one structure only
FEW_SIZES = 6  # up to which each size is shown by itself
MOST_STRUCTURES = 12  # in a table for people
MOST_CLASSES = 7  # of sizes; with the target as many as there are colours


@dataclass(frozen=True, eq=False, repr=False)
class Growth(Shown, Tabular):
    """Every event of one network-free run.

    structures : (S,) canonical, first those at time 0, then in the order in which they first formed
    initial : (S,) counts at time 0
    times : (E,) tu, rising
    before, after : (E, 2) indices of the structures that an event consumed and produced, or NOTHING
    end : time in tu at which observation stopped
    draws : pairs of faces and bonds that were drawn; those that led to no event are the cost of thinning

    >>> from kinetics import ClassRates, grow
    >>> from kinetics.assembly import RuleBook
    >>> (run,) = grow(RuleBook.load("line4"), ClassRates.uniform(join=1e-3), initial=8, end=1e5, seed=1).runs
    >>> run.n_cubes, run.by_size([0.0])[0].tolist()
    (8, [0, 8, 0, 0, 0])
    """

    book: RuleBook
    structures: tuple[Structure, ...]
    initial: Ints
    times: Floats
    before: Ints
    after: Ints
    end: float
    draws: int

    def __post_init__(self) -> None:
        n, events = len(self.structures), len(self.times)
        set_fields(
            self,
            initial=integers("initial", self.initial, (n,), 0),
            times=rising_times(self.times, strictly=False),
            end=float(reals("end", self.end, (), minimum=0)),
            before=integers("before", self.before, (events, 2), NOTHING),
            after=integers("after", self.after, (events, 2), NOTHING),
        )
        for name, indices in (("before", self.before), ("after", self.after)):
            if indices.size and indices.max() >= n:
                raise ValueError(f"{name} holds {indices.max()}; there are only {n} structures")
        if events and self.times[-1] > self.end:
            raise ValueError(f"an event at {self.times[-1]:g} comes after the end, {self.end:g}")
        sizes = np.append(self.sizes, 0)  # NOTHING = -1 picks the last
        wrong = np.flatnonzero(sizes[self.before].sum(axis=1) != sizes[self.after].sum(axis=1))
        if wrong.size:
            raise ValueError(f"event {wrong[0]} at {self.times[wrong[0]]:g} does not conserve cubes")
        self._check_counts()

    def _check_counts(self) -> None:
        """No structure is ever taken that is not there."""
        events, sides, changes = self._changes
        order = np.lexsort((events, sides))
        sides, changes = sides[order], changes[order]
        total = np.cumsum(changes)
        first = np.flatnonzero(np.diff(sides, prepend=NOTHING - 1))
        offset = np.repeat((total - changes)[first], np.diff(first, append=sides.size))
        # What an event takes comes before what it makes, so that this is the least there ever was.
        short = np.flatnonzero(self.initial[sides] + total - offset < 0)
        if short.size:
            raise ValueError(f"an event takes {self.structures[sides[short[0]]]}, of which there is none")

    @property
    def headline(self) -> str:
        """One line: the numbers of events and cubes, and the time."""
        return f"{len(self.times)} events among {self.n_cubes} cubes until {self.end:g} tu, network-free"

    def summary(self) -> ResultTable:
        """Structures, and cubes of the largest, at some of the times."""
        times = np.linspace(0.0, self.end, MOST_TIMES) if self.end else np.zeros(1)
        table = self.by_size(times)
        figures = table.sum(axis=1), table.shape[1] - 1 - np.argmax(table[:, ::-1] > 0, axis=1)
        names = ("structures", "cubes of the largest")
        return over_time(self.headline, times, "tu", names, lambda t, s: str(figures[s][t]))

    @cached_property
    def _changes(self) -> tuple[Ints, Ints, Ints]:
        """TankEvent, structure and change (+1 or -1) of all that was taken and made, event by event, taken first."""
        four = np.concatenate([self.before, self.after], axis=1)
        events, columns = np.nonzero(four != NOTHING)
        return events, four[events, columns], np.where(columns < 2, -1, 1)

    @cached_property
    def sizes(self) -> Ints:
        """Cubes (S,) of each structure."""
        return read_only(np.array([len(structure) for structure in self.structures], dtype=np.int64))

    def until(self, end: float) -> Growth:
        """A copy observed only until an earlier time, tu."""
        kept = int(np.searchsorted(self.times, end, side="right"))
        return replace(self, times=self.times[:kept], before=self.before[:kept], after=self.after[:kept], end=end)

    @property
    def n_cubes(self) -> int:
        """Cubes in the tank."""
        return int(self.initial @ self.sizes)

    def index(self, structure: Structure) -> int | None:
        """Index of a structure in any placement and orientation; None if it never occurred."""
        return self._index.get(structure.canonical(self.book.scheme))

    @cached_property
    def _index(self) -> dict[Structure, int]:
        return {structure: index for index, structure in enumerate(self.structures)}

    def count(self, structure: Structure, times: ArrayLike) -> Ints:
        """Copies (T,) of a structure at times (T,), tu; at an event's own time, those after it."""
        grid, index = self._grid(times), self.index(structure)
        if index is None:
            return np.zeros(grid.size, dtype=np.int64)
        events, sides, changes = self._changes
        mine = sides == index
        copies = np.append(0, np.cumsum(changes[mine])) + int(self.initial[index])
        return copies[np.searchsorted(self.times[events[mine]], grid, side="right")]

    def by_size(self, times: ArrayLike, most: int | None = None) -> Ints:
        """Structures (T, most + 1) of 0, 1, 2, ... cubes at times (T,), tu; `most` is by default the largest size."""
        grid = self._grid(times)
        table = np.zeros((grid.size + 1, max(int(self.sizes.max()), most or 0) + 1), dtype=np.int64)
        np.add.at(table[0], self.sizes, self.initial)
        events, sides, changes = self._changes
        np.add.at(table, (np.searchsorted(grid, self.times[events]), self.sizes[sides]), changes)
        return np.cumsum(table, axis=0)[: grid.size]

    def at(self, time: float) -> dict[Structure, int]:
        """Contents of the tank at a time, tu: structure -> count, the smallest first."""
        (asked,) = self._grid([time])
        events, sides, changes = self._changes
        until = sides[: np.searchsorted(self.times[events], asked, side="right")]
        counts = self.initial.copy()
        np.add.at(counts, until, changes[: until.size])
        held = sorted(np.flatnonzero(counts).tolist(), key=lambda s: (self.sizes[s], s))
        return {self.structures[s]: int(counts[s]) for s in held}

    def first_time(self, structure: Structure) -> float:
        """Time in tu at which such a structure first formed; nan if none did by `end`."""
        index = self.index(structure)
        if index is None:
            return float("nan")
        if self.initial[index]:
            return 0.0
        return float(self.times[np.flatnonzero((self.after == index).any(axis=1))[0]])

    def milestones(self, n: int) -> Floats:
        """At most n times, tu, at which the largest structure grew beyond all before, the first and last included."""
        made = np.append(self.sizes, 0)[self.after].max(axis=1)  # NOTHING = -1 picks the last
        record = np.maximum.accumulate(np.append(self.sizes[self.initial > 0].max(), made))
        outgrown: Floats = np.append(0.0, self.times)[np.append(True, np.diff(record) > 0)]
        return outgrown[np.unique(np.rint(np.linspace(0, outgrown.size - 1, n)).astype(np.int64))]

    def frames(self, times: ArrayLike) -> list[Structure]:
        """The largest structure at each of the times, tu, oriented so that the cubes it keeps stay in place."""
        shown: list[Structure] = []
        for time in self._grid(times):
            largest = list(self.at(float(time)))[-1]
            shown.append(aligned(largest, shown[-1], self.book.scheme) if shown else largest)
        return shown

    def to_dataframe(self) -> pd.DataFrame:
        """One row per event: time in tu, the structures consumed and those produced, as text."""
        names = [*map(str, self.structures), ""]  # NOTHING picks the last
        sides = {
            name: [" + ".join(filter(None, (names[s] for s in pair))) for pair in side.tolist()]
            for name, side in (("before", self.before), ("after", self.after))
        }
        return dataframe({"time": self.times, **sides})

    def _grid(self, times: ArrayLike) -> Floats:
        grid = rising_times(times)
        if grid.size and grid[-1] > self.end:
            raise ValueError(f"the run was observed until {self.end:g}; {grid[-1]:g} was requested")
        return grid


def aligned(structure: Structure, to: Structure, scheme: str) -> Structure:
    """The structure, turned and moved so that as many cubes as can be lie as they do in another one."""
    reduced = scheme_of(scheme).reduced
    theirs, looks = np.array(to.positions), reduced[list(to.rotations)]
    best, most = Placement(0, (0, 0, 0)), -1
    for rotation in range(24):
        mine = np.array(structure.positions) @ ROTATIONS[rotation].T
        alike = reduced[compose[rotation, list(structure.rotations)]][:, None] == looks
        shifts, votes = np.unique((theirs - mine[:, None])[alike], axis=0, return_counts=True)
        if votes.size and votes.max() > most:
            most = int(votes.max())
            x, y, z = shifts[votes.argmax()].tolist()
            best = Placement(rotation, (x, y, z))
    return structure.moved(best)


@dataclass(frozen=True, eq=False, repr=False)
class Growths(Shown):
    """Independent network-free runs of one tank.

    interrupted : whether more runs were requested
    truncated : time (runs,) in tu at which each run made its last event allowed, inf if it did not; all runs end at the
        first of these times. Empty if no run did

    >>> from kinetics import ClassRates, grow
    >>> from kinetics.assembly import RuleBook
    >>> grown = grow(RuleBook.load("line4"), ClassRates.uniform(join=1e-3), initial=8, end=1e5, runs=3, seed=1)
    >>> bool((grown.by_size([0.0, 1e5]) @ range(grown.most + 1) == 8).all())  # cubes are conserved
    True
    >>> grown.count(grown.target, [1e5])[:, 0].tolist()
    [2, 2, 2]
    """

    runs: tuple[Growth, ...]
    interrupted: bool = False
    truncated: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.runs:
            raise ValueError("no runs; expected at least one")
        tanks = {(run.n_cubes, run.end) for run in self.runs}
        if len(tanks) > 1:
            raise ValueError(f"the runs have different (cubes, ends): {sorted(tanks)}; expected runs of one tank")

    @property
    def headline(self) -> str:
        """One line: the numbers of runs and cubes, and the time."""
        first = self.runs[0]
        return f"{len(self.runs)} network-free runs of {first.n_cubes} cubes until {first.end:g} tu"

    def summary(self) -> ResultTable:
        """A table of the mean copies of structures at the end, at most `MOST_STRUCTURES` of them."""
        held = self.final()
        shown = list(held.items())[:MOST_STRUCTURES]
        rows = [(str(len(structure)), f"{copies:.4g}", str(structure)) for structure, copies in shown]
        rest = len(held) - len(shown)
        notes = [f"{rest} more structures"] if rest else []
        notes += ["interrupted: more runs were requested"] if self.interrupted else []
        return ResultTable(self.headline, ("cubes", "mean copies at the end", "structure"), rows, notes)

    @property
    def book(self) -> RuleBook:
        """The rules of all runs."""
        return self.runs[0].book

    @property
    def target(self) -> Structure | None:
        """The finished structure, if the book names one."""
        return self.book.target

    @property
    def most(self) -> int:
        """Number of cubes in the largest structure that occurred."""
        return max(int(run.sizes.max()) for run in self.runs)

    def by_size(self, times: ArrayLike) -> Ints:
        """Structures (runs, T, M + 1) of 0, 1, 2, ..., M cubes at times (T,), tu; M is the largest size in any run."""
        return np.stack([run.by_size(times, self.most) for run in self.runs])

    def count(self, structure: Structure, times: ArrayLike) -> Ints:
        """Copies (runs, T) of a structure at times (T,), tu."""
        return np.stack([run.count(structure, times) for run in self.runs])

    def largest(self, times: ArrayLike) -> Ints:
        """Cubes (runs, T) of the largest structure at times (T,), tu."""
        present = self.by_size(times)[..., ::-1] > 0
        return np.asarray(self.most - present.argmax(axis=-1))

    def first_times(self, structure: Structure) -> Floats:
        """Times (runs,) in tu at which such a structure first formed; nan if none did by the end."""
        return np.array([run.first_time(structure) for run in self.runs])

    def final(self) -> dict[Structure, float]:
        """Contents of the tank at the end: structure -> mean count per run, those that hold most cubes first."""
        totals: dict[Structure, int] = {}
        for run in self.runs:
            for structure, copies in run.at(run.end).items():
                totals[structure] = totals.get(structure, 0) + copies
        order = sorted(totals, key=lambda s: (-totals[s] * len(s), len(s), str(s)))
        return {structure: totals[structure] / len(self.runs) for structure in order}

    def classes(self, most: int | None = None) -> list[tuple[int, int]]:
        """Classes of sizes, (smallest, largest): single sizes if they are few, else ranges that grow by a factor.

        most : the largest size, as it may be in other runs too; None: that of these runs
        """
        most = most or self.most
        if most <= FEW_SIZES:
            return [(size, size) for size in range(1, most + 1)]
        factor = 2
        while factor**MOST_CLASSES <= most:
            factor *= 2
        edges = [factor**power for power in range(MOST_CLASSES) if factor**power <= most]
        return [(low, min(factor * low - 1, most)) for low in edges]

    def series(self, times: ArrayLike, most: int | None = None) -> dict[str, Ints]:
        """Counts (runs, T) by size class, counts of the target, and the cubes of the largest structure.

        most : as in `classes`
        """
        table = self.by_size(times)
        found = {_class_name(*ends): table[:, :, ends[0] : ends[1] + 1].sum(axis=2) for ends in self.classes(most)}
        if self.target is not None:
            found["target"] = self.count(self.target, times)
        return found | {"largest": self.largest(times)}

    def to_dataframe(self, times: ArrayLike) -> pd.DataFrame:
        """One row per run and time: run, time in tu, and the series."""
        grid = rising_times(times)
        table = {"run": np.repeat(np.arange(len(self.runs)), grid.size), "time": np.tile(grid, len(self.runs))}
        return dataframe(table | {name: values.ravel() for name, values in self.series(grid).items()})

    @on_axes
    def plot(self, ax: Any, times: ArrayLike) -> Any:
        """Plot means, with bands of the middle 95 % of the runs; returns `ax`.

        Shown are the classes of sizes and the target or, where growth starts from one seed, the size of the largest
        structure.
        """
        shown = self.series(times)
        largest = shown.pop("largest")
        target = shown.pop("target", None)
        if target is not None and not any(np.array_equal(target, values) for values in shown.values()):
            shown["target"] = target  # else it is all there is of its size, and would hide that curve
        seeded = self.book.seed_letter is not None
        curves: Sequence[Ints] = [largest] if seeded else list(shown.values())
        names = ["largest structure"] if seeded else list(shown)
        middle, low, high = (
            np.stack([reduce_runs(values) for values in curves], axis=1)
            for reduce_runs in (lambda v: v.mean(axis=0), lambda v: _quantile(v, 0.025), lambda v: _quantile(v, 0.975))
        )
        label = "number of cubes" if seeded else plots.COUNT
        return plots.bands(ax, rising_times(times), middle, low, high, names, label=label)


def _class_name(low: int, high: int) -> str:
    if low == high:
        return "1 cube" if low == 1 else f"{low} cubes"
    return f"{low} to {high} cubes"


def _quantile(values: Ints, q: float) -> Floats:
    """Smallest counts (T,) with at least a share q of the runs at or below them."""
    return np.quantile(values.astype(np.float64), q, axis=0, method="inverted_cdf")
