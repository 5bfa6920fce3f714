"""The yield of a book by the rate equations of its network: what the compiler chooses by, before there are letters.

All books of the compiler with the same joins have the same network, so sets of joins are compared by it alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from kinetics.assembly.compiler.plan import Channel, Plan
from kinetics.assembly.deriving.derive import Derivation
from kinetics.support.packages import integrate

# Free cubes at first, time in tu, and rates in 1/tu of a pair of faces and of a bond.
CUBES, DURATION, JOIN, BREAK = 60, 2000.0, 1e-4, 1e-4
LOW = 0.1  # below which a book is of little use
CONDITIONS = f"{CUBES} cubes, {DURATION:,.0f} tu, join = {JOIN:g}, by the rate equations"


class Yields(NamedTuple):
    """The share of CUBES free cubes that are in targets after DURATION, every way of joining at the rate JOIN.

    holding : if no bond breaks; breaking : if every bond outside loops breaks at BREAK; None where bonds hold

    By the rate equations, which know no scatter: from 60 cubes they are off by a few hundredths. Rounded to .001, so
    that it does not depend on the machine which book is chosen.
    """

    holding: float
    breaking: float | None

    @property
    def mean(self) -> float:
        """Of both, because nobody knows yet how often bonds break."""
        return self.holding if self.breaking is None else (self.holding + self.breaking) / 2

    @property
    def warning(self) -> str | None:
        """That a yield is low; None: none is."""
        low = [words for words, value in self._parts() if value < LOW]
        return f"yield below {LOW:g} ({', '.join(low)}): few targets will be made in this time" if low else None

    def as_dict(self) -> dict[str, float | None]:
        """Both, with the conditions, ready for JSON."""
        return {
            "no_breaks": self.holding,
            "breaks": self.breaking,
            "cubes": CUBES,
            "duration": DURATION,
            "join": JOIN,
            "break": BREAK,
        }

    def __str__(self) -> str:
        return f"yield {', '.join(f'{value:.2f} ({words})' for words, value in self._parts())}"

    def _parts(self) -> list[tuple[str, float]]:
        both = [("no breaks", self.holding), (f"break = {BREAK:g}", self.breaking)]
        return [(words, value) for words, value in both if value is not None]


class _Reaction(NamedTuple):
    """What a join or a break takes and makes, and in how many ways."""

    before: Sequence[int]
    after: Sequence[int]
    ways: float


def yields_of(derived: Derivation) -> Yields | None:
    """The yields of a book, by its derived network; None: it has no target, or grows one from each seed."""
    book = derived.book
    if book.target is None or book.seed() is not None:
        return None
    reactions = [_Reaction(*event, sum(ways.values())) for event, ways in derived.events.items()]
    sizes = [len(structure) for structure in derived.structures.values()]
    free, target = (derived.species_of(structure) for structure in (book.monomer(), book.target))
    return _yields(reactions, sizes, free, target, book.semantics.bonds == "break")


def yields_with(plan: Plan, joins: Iterable[Channel]) -> Yields:
    """The yields of every book of a plan with these joins, whatever its letters."""
    reactions = [_Reaction((a, b), (c,), plan.dockings.ways[a, b, c]) for a, b, c in joins]
    reactions += [_Reaction((c,), (a, b), n) for (a, b, c), n in plan.bonds.items()]
    sizes = [len(part) for part in plan.parts]
    return _yields(reactions, sizes, 0, len(sizes) - 1, bool(plan.breaks))


def _yields(reactions: Sequence[_Reaction], sizes: Sequence[int], free: int, target: int, is_breaking: bool) -> Yields:
    change, before, rates = np.zeros((len(reactions), len(sizes) + 1)), [], []
    for row, (taken, made, ways) in enumerate(reactions):
        np.add.at(change[row], list(taken), -1)
        np.add.at(change[row], list(made), 1)
        before.append([*taken, len(sizes)][:2])  # the last place is always 1, the partner of what breaks
        like = 0.5 if len(set(taken)) < len(taken) else 1.0
        rates.append(ways * (JOIN * like if len(taken) == 2 else BREAK))
    start = np.zeros(len(sizes) + 1)
    start[[free, -1]] = CUBES, 1.0
    first, second = np.array(before).T

    def share(constants: np.ndarray) -> float:
        done = integrate.solve_ivp(
            lambda _, y: (constants * y[first] * y[second]) @ change,
            (0.0, DURATION),
            start,
            method="LSODA",
            rtol=1e-5,
            atol=1e-5,
        )
        return round(float(done.y[target, -1] * sizes[target] / CUBES), 3)

    rate = np.array(rates)
    return Yields(share(rate * (second < len(sizes))), share(rate) if is_breaking else None)
