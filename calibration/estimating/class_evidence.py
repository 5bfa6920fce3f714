"""What runs say of each rate class, whatever book they are of: events and exposures, pooled over books.

A class has one constant in every book, so that its events add up over all channels of all books that have ways of it,
and so do their exposures. Breaks are kept partner by partner, by the partner's size: sizes mean the same in any book.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.exposure import count, sojourns
from calibration.estimating.named_partners import may_have_broken
from kinetics.assembly import Derivation, RateClass
from kinetics.network import Tank
from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats, Ints


class BookRuns(NamedTuple):
    """Runs of one book, as paths of its derived network."""

    derivation: Derivation
    paths: tuple[JumpPath, ...]


@dataclass(frozen=True, eq=False)
class ClassEvidence:
    """The joins, or the breaks, of runs.

    classes : the K classes of their books
    ways : (L, K) ways by class of each sort of channel; a channel that has ways of several classes fires for any
    sorts : (n,) sort of the channel of each event
    at_events : (n, C) pairs with each partner at each event; of joins one column of ones
    named : (n, C) the partners that the record of it allows; None where nobody watched
    exposure : (K, C) integral over time of the ways of a class times their pairs, tu, in the tank `tank`
    sizes : (C - 2,) the partners are bodies of these sizes, then the wall, then nobody; none for joins
    """

    event: Literal["join", "break"]
    classes: tuple[RateClass, ...]
    ways: Floats
    sorts: Ints
    at_events: Floats
    named: NDArray[np.bool_] | None
    exposure: Floats
    sizes: Floats
    tank: Tank | None


def class_evidence(books: Iterable[BookRuns]) -> tuple[ClassEvidence, ClassEvidence]:
    """Evidence of joins and of breaks, in the tank of the first run.

    Runs of one book need its derived network; books, tanks and initial states may all differ. Meetings are scaled to
    the tank of the first run by volume, and hits on walls by surface over volume.

    Cost: one pass over the paths.
    ValueError: no runs, face schemes that differ, paths of another network, or tanks of which only some are known.
    """
    groups = [BookRuns(derivation, tuple(paths)) for derivation, paths in books]
    runs = [path for group in groups for path in group.paths]
    if not runs:
        raise ValueError("no runs to estimate from; give at least one path")
    schemes = {group.derivation.book.scheme for group in groups}
    if len(schemes) > 1:
        raise ValueError(f"books with the faces {', '.join(sorted(schemes))}: their face types mean different things")
    if len({run.tank is None for run in runs}) > 1:
        raise ValueError("some runs state their tank and others do not; state it for all of them, or for none")
    for group in groups:
        for path in group.paths:
            if path.network.fingerprint != group.derivation.network.fingerprint:
                raise ValueError(f"a path is not of the network of book {group.derivation.book.name!r}")
    tank = runs[0].tank
    return _joins(groups, tank), _breaks(groups, tank)


class _Sorts:
    """Numbers of the sorts of channels of one kind: channels of the same ways by class are of one sort."""

    def __init__(self, groups: Sequence[BookRuns], event: str):
        found = {c for group in groups for c in group.derivation.rate_classes if c.event == event}
        self.classes = tuple(sorted(found))
        self.places = {c: i for i, c in enumerate(self.classes)}
        self.known: dict[tuple[tuple[int, float], ...], int] = {}

    def of(self, derivation: Derivation) -> tuple[Ints, Floats]:
        """Sort (R,) of each channel, -1 for those of the other kind, and its ways by class (R, K)."""
        sorts = np.full(len(derivation.events), -1, dtype=np.int64)
        ways = np.zeros((len(derivation.events), len(self.classes)))
        for channel, by_class in enumerate(derivation.events.values()):
            row = tuple(sorted((self.places[c], float(n)) for c, n in by_class.items() if c in self.places))
            if row:
                sorts[channel] = self.known.setdefault(row, len(self.known))
                for place, n in row:
                    ways[channel, place] = n
        return sorts, ways

    @property
    def table(self) -> Floats:
        """Ways (L, K) of each sort."""
        table = np.zeros((len(self.known), len(self.classes)))
        for row, sort in self.known.items():
            for place, n in row:
                table[sort, place] = n
        return table


def _joins(groups: Sequence[BookRuns], tank: Tank | None) -> ClassEvidence:
    sorts = _Sorts(groups, "join")
    exposure, fired = np.zeros((len(sorts.classes), 1)), [np.zeros(0, dtype=np.int64)]
    for derivation, paths in groups:
        numbers, ways = sorts.of(derivation)
        per_way = ways / derivation.network.ways[:, None]
        for path in paths:
            rarer = 1.0 if path.tank is None or tank is None else tank.dilution(path.tank)
            exposure[:, 0] += rarer * (count(path).exposure @ per_way)
            seen = numbers[path.channels[path.channels != RESTART]]
            fired.append(seen[seen >= 0])
    events = np.concatenate(fired)
    ones = np.ones((events.size, 1))
    return ClassEvidence("join", sorts.classes, sorts.table, events, ones, None, exposure, np.zeros(0), tank)


def _breaks(groups: Sequence[BookRuns], tank: Tank | None) -> ClassEvidence:
    sorts = _Sorts(groups, "break")
    largest = max(len(s) for group in groups for s in group.derivation.structures.values())
    bodies, columns = np.arange(1, largest + 1), largest + 2
    of_whole = np.array([sum(c.sizes) for c in sorts.classes], dtype=np.int64)
    exposure = np.zeros((len(sorts.classes), columns))
    fired, at_events, named = [np.zeros(0, dtype=np.int64)], [np.zeros((0, columns))], [np.zeros((0, columns), bool)]
    is_watched = all(path.partners is not None for group in groups for path in group.paths)
    for derivation, paths in groups:
        numbers, ways = sorts.of(derivation)
        broken = np.flatnonzero(numbers >= 0)
        reactants = derivation.network.sparse_reactants
        whole = np.array([int(reactants.row(channel)[0][0]) for channel in broken.tolist()], dtype=np.int64)
        sizes = np.array([len(s) for s in derivation.structures.values()])
        is_size = (sizes[:, None] == bodies).astype(float)
        for path in paths:
            factors = _factors(columns, tank, path.tank)
            bonds = np.zeros((sizes.size, len(sorts.classes)))
            np.add.at(bonds, whole, ways[broken] * path.open_channels[broken, None])
            begin, end, _ = sojourns(path)
            states = path.states
            held = (end - begin)[:, None] * (states @ bonds)  # tu of bonds of each class, (E + 1, K)
            around = states @ is_size  # bodies by size, (E + 1, M)
            total = held.sum(axis=0)
            pairs = np.column_stack([held.T @ around, total, total])
            pairs[np.arange(of_whole.size), of_whole - 1] -= total  # a body does not meet itself
            exposure += factors * pairs
            rows = np.flatnonzero((path.channels != RESTART) & (numbers[path.channels] >= 0))
            fired.append(numbers[path.channels[rows]])
            of = sizes[_wholes(path, rows, whole, broken)]
            there = np.column_stack([around[rows], np.ones((rows.size, 2))])
            there[np.arange(rows.size), of - 1] -= 1
            at_events.append(factors * there)
            if is_watched and path.partners is not None:
                named.append(may_have_broken(path.partners[rows], sizes - 1, columns - 2, columns))
    return ClassEvidence(
        "break",
        sorts.classes,
        sorts.table,
        np.concatenate(fired),
        np.concatenate(at_events),
        np.concatenate(named) if is_watched else None,
        exposure,
        bodies.astype(float),
        tank,
    )


def _factors(columns: int, tank: Tank | None, path_tank: Tank | None) -> Floats:
    """What brings pairs (C,) of a run's tank to those of another one."""
    factors = np.ones(columns)
    if tank is not None and path_tank is not None:
        factors[:-2], factors[-2] = tank.dilution(path_tank), tank.wall_factor(path_tank)
    return factors


def _wholes(path: JumpPath, rows: NDArray[np.intp], whole: Ints, broken: NDArray[np.intp]) -> Ints:
    """The species that broke at some events."""
    of_channel = np.zeros(len(path.network.channels), dtype=np.int64)
    of_channel[broken] = whole
    return of_channel[path.channels[rows]]
