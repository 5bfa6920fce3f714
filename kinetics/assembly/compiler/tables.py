"""Rule books from tables of readings, with as few conditions as exclude every forbidden docking."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection
from itertools import combinations
from typing import Any

from kinetics.assembly.compiler.dockings import Reading
from kinetics.assembly.compiler.growth import SIDE
from kinetics.assembly.compiler.merging import ReadingTables
from kinetics.assembly.rules.conditions import Combination, Internal, Senses

FREE = "a"
Neighbours = tuple[int, ...]
Condition = tuple[str, Neighbours]  # the kind, `has` or `neighbours`, "" for none; and what it asks for


def rules_of(
    tables: ReadingTables, names: dict[int, str], senses: Senses
) -> tuple[tuple[Combination, ...], tuple[Internal, ...]]:
    """The simplest rules that follow the tables; readings outside the tables are free.

    names : of the letters; senses : of the cubes
    """
    return (*_guests(tables, names, senses), *_hosts(tables, names, senses)), _internal(tables, names)


def _guests(tables: ReadingTables, names: dict[int, str], senses: Senses) -> list[Combination]:
    """What a free cube becomes; partners that mean the same come together."""
    partners: defaultdict[tuple[str, str, str, Neighbours, int], set[str]] = defaultdict(set)
    for (_, own, _, _, letter, face, roll, touched), becomes in tables.guests.items():
        partners[own, face, roll or "", touched or (), becomes].add(names[letter])
    rules = []
    title = _Titles()
    for (own, face, roll, touched, becomes), some in sorted(partners.items(), key=lambda item: (item[0][4], item[0])):
        beside = _named(touched, names)
        rules.append(
            Combination(
                rule=title(f"{FREE} docks at {' '.join(beside or sorted(some))}"),
                letter=(FREE,),
                face=(own,),
                partner=tuple(sorted(some)),
                partner_face=(face,),
                roll=(roll,) if roll and own == face == SIDE else None,  # else determined by the faces
                touched=beside if senses.touched else None,
                becomes=names[becomes],
            )
        )
    return rules


def _hosts(tables: ReadingTables, names: dict[int, str], senses: Senses) -> list[Combination]:
    """Which cubes let a free one dock; they keep their letters."""
    refused = {host for host, guest in tables.forbidden if guest in tables.guests} - tables.hosts
    rules = []
    title = _Titles()
    for letter, face in sorted({(host.own, host.face) for host in tables.hosts}):
        hosts, others = ([h for h in some if (h.own, h.face) == (letter, face)] for some in (tables.hosts, refused))
        # how the newcomer is turned is for itself to see; asked here only if all else is the same
        is_clear = {h.around for h in hosts}.isdisjoint(h.around for h in others)
        ways = {None} if is_clear else {_way(h) for h in hosts}
        for way in sorted(ways, key=repr):
            good, bad = ({h.around for h in some if way in {None, _way(h)}} for some in (hosts, others))
            own, roll, across = way or (None, None, None)
            rules += [
                Combination(
                    rule=title(f"{names[letter]} takes {FREE} on {face}"),
                    letter=(names[letter],),
                    face=(face,),
                    partner=(FREE,),
                    partner_face=(own,) if own else None,
                    roll=(roll,) if roll and own == face == SIDE else None,
                    across=(names.get(across, ""),) if across is not None and senses.across else None,
                    becomes=names[letter],
                    **_condition(condition, names),
                )
                for condition in covering(good, bad)
            ]
    return rules


def _way(host: Reading) -> tuple[str, str | None, int]:
    """How the newcomer is turned that docks to a cube, and the letter across."""
    return host.partner_face, host.roll, host.across


def _internal(tables: ReadingTables, names: dict[int, str]) -> tuple[Internal, ...]:
    """How letters follow their neighbours."""
    rules: list[Internal] = []
    title = _Titles()
    for letter in tables.letters:
        read = {near: becomes for (own, near), becomes in tables.internal.items() if own == letter}
        ends = sorted(set(read.values()) - {letter})
        for becomes in ends:
            good = {near for near, result in read.items() if result == becomes}
            # rules that lead to different letters have to be told apart even if nothing ever reads so
            conditions = covering(good, read.keys() - good) if len(ends) == 1 else [("neighbours", n) for n in good]
            rules.extend(
                Internal(
                    rule=title(f"{names[letter]} follows to {names[becomes]}"),
                    letter=(names[letter],),
                    becomes=names[becomes],
                    **_condition(condition, names),
                )
                for condition in sorted(conditions)
            )
    return tuple(rules)


def covering(good: Collection[Neighbours], bad: Collection[Neighbours]) -> list[Condition]:
    """A few conditions on neighbours that hold for all good ones and for no bad one.

    Each either asks for nothing, or for some letters at least, or for exactly these neighbours.
    """
    candidates: list[Condition] = [("", ())]
    parts = {part for near in good for size in range(1, len(near)) for part in combinations(near, size)}
    candidates += [("has", part) for part in sorted(parts, key=lambda p: (len(p), p))]
    candidates += [("neighbours", near) for near in sorted(good)]
    held = {condition: {near for near in good if _holds(condition, near)} for condition in candidates}
    fitting = [condition for condition in candidates if not any(_holds(condition, near) for near in bad)]
    chosen, missing = [], set(good)
    while missing:
        best = max(fitting, key=lambda condition: len(held[condition] & missing))  # of equals, the simplest
        chosen.append(best)
        missing -= held[best]
    return chosen


def _holds(condition: Condition, near: Neighbours) -> bool:
    kind, letters = condition
    return near == letters if kind == "neighbours" else Counter(letters) <= Counter(near)


def _condition(condition: Condition, names: dict[int, str]) -> dict[str, Any]:
    kind, letters = condition
    return {kind: _named(letters, names)} if kind else {}


def _named(letters: Neighbours, names: dict[int, str]) -> tuple[str, ...]:
    return tuple(sorted([names[letter] for letter in letters]))


class _Titles:
    """Names of rules, each given once."""

    def __init__(self) -> None:
        self.given: Counter[str] = Counter()

    def __call__(self, text: str) -> str:
        self.given[text] += 1
        return text if self.given[text] == 1 else f"{text}, {self.given[text]}"
