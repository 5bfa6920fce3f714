"""The merging of letters: fewer of them, without misleading any cube.

Merging two letters makes some readings alike. Where those lead to different letters, these have to be merged as well;
if one is of a cube that must not dock, the merge is refused. What is left grows exactly as before, step by step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

from kinetics.assembly.compiler.dockings import Reading
from kinetics.assembly.compiler.growth import FREE, NOBODY, Around, Docking, Facts


@dataclass(frozen=True)
class ReadingTables:
    """Reading -> reaction of a cube.

    hosts : readings of a cube that lets another one dock
    guests : reading of a cube that docks -> its letter
    internal : reading of a bonded cube -> its letter in the next round
    forbidden : pairs of readings that must not both be in the tables
    merged : letter -> the one that stands for it
    """

    hosts: frozenset[Reading]
    guests: dict[Reading, int]
    internal: dict[Around, int]
    forbidden: frozenset[Docking]
    merged: dict[int, int]

    @property
    def letters(self) -> list[int]:
        """Those in use, in order."""
        return sorted(set(self.merged.values()))

    @property
    def misleads(self) -> bool:
        """Whether a cube that must not dock looks like one that may."""
        return any(host in self.hosts and guest in self.guests for host, guest in self.forbidden)

    def joined(self, a: int, b: int) -> ReadingTables:
        """The tables with two letters merged, and all that follows from it."""
        parent: dict[int, int] = {}

        def root(letter: int) -> int:
            while letter in parent:
                letter = parent[letter]
            return letter

        waiting = [(a, b)]
        while waiting:
            for x, y in waiting:
                low, high = sorted((root(x), root(y)))
                if low != high:
                    parent[high] = low
            name = {letter: root(letter) for letter in (FREE, NOBODY, *self.letters)}
            guests: dict[Reading, int] = {}
            internal: dict[Around, int] = {}
            waiting = []
            for reading, letter in self.guests.items():
                if (known := guests.setdefault(_renamed(reading, name), name[letter])) != name[letter]:
                    waiting.append((known, letter))
            for (own, near), letter in self.internal.items():
                if (known := internal.setdefault((name[own], _many(near, name)), name[letter])) != name[letter]:
                    waiting.append((known, letter))
        hosts = frozenset(_renamed(reading, name) for reading in self.hosts)
        now = {reading: _renamed(reading, name) for reading in set(chain.from_iterable(self.forbidden))}
        forbidden = frozenset((now[host], now[guest]) for host, guest in self.forbidden)
        merged = {letter: name[now] for letter, now in self.merged.items()}
        return ReadingTables(hosts, guests, internal, forbidden, merged)


def tables_of(facts: Facts) -> ReadingTables | None:
    """The tables of a growth, with all letters; None if some cube could not dock without misleading another."""
    allowed = {docking for event in facts.events for docking in event} - facts.forbidden
    guests: dict[Reading, int] = {}
    for event, letter in facts.events.items():
        for _, guest in event & allowed:
            if guests.setdefault(guest, letter) != letter:
                return None
    # a bond takes a rule of either side, so a pair of rules may enable what neither was made for
    hosts = {host for host, _ in allowed}
    crossed = sorted(d for d in facts.forbidden if d[0] in hosts and d[1] in guests)
    for docking in crossed:
        without = {d for d in allowed if d[0] != docking[0]}
        if not all(event & without for event in facts.events):
            without = {d for d in allowed if d[1] != docking[1]}
        allowed = without
    if not all(event & allowed for event in facts.events):
        return None
    guests = {guest: letter for event, letter in facts.events.items() for _, guest in event & allowed}
    kinds = {guest.kind for guest in guests}
    forbidden = frozenset(docking for docking in facts.forbidden if docking[1].kind in kinds)  # no other ever matters
    letters = sorted({letter for letter, _ in facts.internal} | set(facts.internal.values()))
    merged = {letter: letter for letter in letters}
    return ReadingTables(frozenset(host for host, _ in allowed), guests, facts.internal, forbidden, merged)


def _many(letters: tuple[int, ...], name: dict[int, int]) -> tuple[int, ...]:
    return tuple(sorted([name[letter] for letter in letters]))


def _renamed(reading: Reading, name: dict[int, int]) -> Reading:
    own, face, near, across, partner, partner_face, roll, touched = reading
    beside = touched and _many(touched, name)
    return Reading(name[own], face, _many(near, name), name[across], name[partner], partner_face, roll, beside)


def reduced(tables: ReadingTables, rng: np.random.Generator, tick: Callable[[], None] = lambda: None) -> ReadingTables:
    """Merge letters, in a random order, until no two can be merged any more; tick is called at every attempt."""
    refused: set[tuple[int, int]] = set()
    while True:
        pairs = [pair for pair in combinations(tables.letters, 2) if pair not in refused]
        for number in rng.permutation(len(pairs)).tolist():
            tick()
            pair = pairs[number]
            fewer = tables.joined(*pair)
            if not fewer.misleads:
                tables = fewer
                break
            refused.add(pair)  # a merge of more letters would only be harder
        else:
            return tables


def named(tables: ReadingTables, seed: int) -> dict[int, str]:
    """Names for all letters, merged ones alike: b for the seed's, and on in the order in which they first occurred."""
    names: dict[int, str] = {}
    for letter in (tables.merged[seed], *tables.letters):
        names.setdefault(letter, letter_name(len(names) + 1))
    return {letter: names[now] for letter, now in tables.merged.items()}


def letter_name(number: int) -> str:
    """a, b, ... z, a1, b1, ..."""
    suffix, place = divmod(number, 26)
    return chr(ord("a") + place) + (str(suffix) if suffix else "")
