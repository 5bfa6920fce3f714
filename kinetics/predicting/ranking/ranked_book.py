"""A rule book in a ranking: checked and derived, with its yield and first-assembly time."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from kinetics.assembly import Derivation, RuleBook, Structure, StructureEvent, check, derive
from kinetics.network import Model
from kinetics.predicting.ranking.yield_and_first_time import (
    YieldAndFirstTime,
    load_kernels,
    yield_and_first_time,
)
from kinetics.rates import ClassRates
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, read_only
from kinetics.support.cli.progress import stage

Measure = Literal["yield", "first"]
MEASURES: tuple[Measure, ...] = ("yield", "first")
RUNS_PER_DRAW = 100
LIMITS = (0.025, 0.975)


@dataclass(frozen=True, eq=False)
class RankedBook:
    """One book with its yield and first-assembly time.

    pathway : see the function of that name
    letters, rules : how many the book has
    result : at the rates' point values
    drawn : (draws, 2) yield and mean time to the first target under each draw of the rates, the same draws for all
        books; no rows where the rates are taken as known
    """

    name: str
    pathway: tuple[str, ...]
    letters: int
    rules: int
    result: YieldAndFirstTime
    drawn: Floats
    cpu_seconds: float

    def answer(self, measure: Measure) -> Answer:
        """The answer that `measure` ranks by."""
        return self.result.yield_ if measure == "yield" else self.result.first

    def from_rates(self, measure: Measure) -> tuple[float, float] | None:
        """95 % interval of a mean from the rates' uncertainty; None if the rates are taken as known.

        Where draws are sampled it holds their noise too, so it is rather too wide.
        """
        if not len(self.drawn):
            return None
        low, high = np.quantile(self.drawn[:, MEASURES.index(measure)], LIMITS)
        return float(low), float(high)


def pathway(derivation: Derivation, rates: ClassRates) -> tuple[str, ...]:
    """The sizes that are joined on the way from free cubes, as `1+2`, the smallest product first.

    `1+2 x3` where three kinds of join have these sizes. What can only happen at a rate of 0 is left out.
    """
    network, book = rates.base(derivation), derivation.book
    works = [event for event, k in zip(derivation.events, network.known_rates, strict=True) if k > 0]
    starts = (book.monomer(), book.seed())
    present = {derivation.species_of(structure) for structure in starts if structure is not None}
    found: list[StructureEvent] = []
    while len(new := [event for event in works if present.issuperset(event.before)]) > len(found):
        found = new
        present.update(after for event in new for after in event.after)
    sizes = [len(structure) for structure in derivation.structures.values()]
    joins = Counter(tuple(sorted(sizes[s] for s in event.before)) for event in found if len(event.before) == 2)
    return tuple(
        "+".join(map(str, pair)) + (f" x{joins[pair]}" if joins[pair] > 1 else "")
        for pair in sorted(joins, key=lambda pair: (sum(pair), pair))
    )


def target_shape(book: RuleBook) -> Structure:
    """The positions of a target's cubes in canonical orientation, without letters and faces, to compare books by."""
    target = _target(book)
    n = len(target)
    return Structure(target.positions, (0,) * n, ("x",) * n).canonical("one")


def possible_targets(book: RuleBook, cubes: int) -> int:
    """Number of targets that a given number of free cubes could make."""
    size = len(_target(book))
    return cubes // size if book.seed_letter is None else int(cubes + 1 >= size)


def derived(book: RuleBook) -> Derivation:
    """The network of a book that has no errors."""
    derivation = derive(book)
    errors = [finding for finding in check(book, slow_waves=False).findings if finding.is_error]
    if errors:
        kinds = ", ".join(dict.fromkeys(finding.kind for finding in errors))
        raise ValueError(
            f"only correct books are ranked; book {book.name!r} has errors ({kinds}): see `wellmixed rules check`"
        )
    return derivation


def ranked_book(
    derivation: Derivation,
    rates: ClassRates,
    drawn: Sequence[ClassRates],
    cubes: int,
    horizon: float,
    runs: int,
    seed: int,
    max_states: int,
) -> RankedBook:
    """The figures of one book at `rates` and under each of the drawn sets; see `ranking.rank`."""
    load_kernels()
    began = time.process_time()
    book = derivation.book
    # A stream for each book, so that the figures of different books are independent in whatever order they come.
    words = np.random.SeedSequence([seed, int(book.fingerprint, 16)]).generate_state(2, np.uint64)
    own_seed = int(words[0]) << 64 | int(words[1])
    species = derivation.network.species
    counts = {species[derivation.species_of(book.monomer())]: cubes}
    grown_from = book.seed()
    if grown_from is not None:
        grown = species[derivation.species_of(grown_from)]
        counts[grown] = counts.get(grown, 0) + 1
    target, possible = species[derivation.species_of(_target(book))], possible_targets(book, cubes)

    def figures(at: ClassRates, n: int, first_run: int = 0, like: YieldAndFirstTime | None = None) -> YieldAndFirstTime:
        model = Model.of(at.apply(derivation), counts)
        return yield_and_first_time(model, target, possible, horizon, n, own_seed, max_states, first_run, like)

    found = figures(rates, runs)
    table = np.empty((len(drawn), 2))
    for number, (row, some) in enumerate(zip(table, drawn, strict=True)):
        stage(f"{book.name}: {number} of {len(drawn)} draws of the rates")
        one = figures(some, RUNS_PER_DRAW, runs + number * RUNS_PER_DRAW, found)
        row[:] = one.yield_.value, one.first.value
    return RankedBook(
        book.name,
        pathway(derivation, rates),
        len(book.letters),
        len(book.all_rules),
        found,
        read_only(table),
        time.process_time() - began,
    )


def _target(book: RuleBook) -> Structure:
    if book.target is None:
        raise ValueError(f"book {book.name!r} has no target; add one to rank it")
    return book.target
