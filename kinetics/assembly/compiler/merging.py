"""The merging of letters: fewer of them, without misleading any cube.

Merging two letters makes some readings alike. Where those lead to different letters, these have to be merged as well;
where one is of a cube that must not dock, the merge is refused. What is left grows exactly as before, step by step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from kinetics.assembly.compiler.growth import Around, Facts, GuestView, HostView, ViewPair


@dataclass(frozen=True)
class ReadingTables:
    """What cubes do on what they read.

    hosts : readings of a cube that lets another one dock
    guests : reading of a cube that docks -> its letter
    internal : reading of a bonded cube -> its letter in the next round
    forbidden : pairs of readings that must not both be in the tables
    merged : letter -> the one that stands for it
    """

    hosts: frozenset[HostView]
    guests: dict[GuestView, int]
    internal: dict[Around, int]
    forbidden: frozenset[ViewPair]
    merged: dict[int, int]

    @classmethod
    def of(cls, facts: Facts) -> ReadingTables:
        """The tables of a growth without clashes."""
        usable = facts.usable()
        if usable is None:
            raise ValueError("these facts hold a clash; plan the growth so that no cube can be misled")
        guests = {
            contact[1]: letter for event, letter in facts.events.items() for contact in event if contact in usable
        }
        letters = {letter for letter, _ in facts.internal} | set(facts.internal.values())
        hosts = frozenset(host for host, _ in usable)
        return cls(hosts, guests, facts.internal, frozenset(facts.forbidden), {letter: letter for letter in letters})

    @property
    def letters(self) -> list[int]:
        """Those in use, in order."""
        return sorted(set(self.merged.values()))

    def joined(self, a: int, b: int, is_strict: bool = True) -> ReadingTables | None:
        """The tables with two letters merged, and all that follows from it.

        None where a cube that must not dock would look like one that may; with is_strict off, such tables are returned.
        """
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
            name = {letter: root(letter) for letter in self.letters}
            guests: dict[GuestView, int] = {}
            internal: dict[Around, int] = {}
            waiting = []
            for view, letter in self.guests.items():
                if (known := guests.setdefault(_guest(view, name), name[letter])) != name[letter]:
                    waiting.append((known, letter))
            for (own, near), letter in self.internal.items():
                if (known := internal.setdefault((name[own], _many(near, name)), name[letter])) != name[letter]:
                    waiting.append((known, letter))
        hosts = frozenset(_host(view, name) for view in self.hosts)
        forbidden = frozenset((_host(host, name), _guest(guest, name)) for host, guest in self.forbidden)
        if is_strict and any(host in hosts and guest in guests for host, guest in forbidden):
            return None
        merged = {letter: name[now] for letter, now in self.merged.items()}
        return ReadingTables(hosts, guests, internal, forbidden, merged)


def _many(letters: tuple[int, ...], name: dict[int, int]) -> tuple[int, ...]:
    return tuple(sorted([name[letter] for letter in letters]))


def _host(view: HostView, name: dict[int, int]) -> HostView:
    letter, face, near, own, roll, across = view
    return HostView(name[letter], face, _many(near, name), own, roll, name.get(across, across))


def _guest(view: GuestView, name: dict[int, int]) -> GuestView:
    own, letter, face, roll, touched = view
    return GuestView(own, name[letter], face, roll, _many(touched, name))


def reduced(tables: ReadingTables, rng: np.random.Generator, tick: Callable[[], None] = lambda: None) -> ReadingTables:
    """Merge letters, in a random order, until no two can be merged any more; tick is called at every attempt."""
    refused: set[tuple[int, int]] = set()
    while True:
        pairs = [pair for pair in combinations(tables.letters, 2) if pair not in refused]
        for number in rng.permutation(len(pairs)).tolist():
            tick()
            pair = pairs[number]
            fewer = tables.joined(*pair)
            if fewer is not None:
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
