"""The ranking of rule books by yield or first-assembly time, with ties within the errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinetics.assembly import RuleBook
from kinetics.predicting.ranking.ranked_book import (
    LIMITS,
    MEASURES,
    Measure,
    RankedBook,
    derived,
    possible_targets,
    ranked_book,
    target_shape,
)
from kinetics.predicting.ranking.yield_and_first_time import MAX_STATES
from kinetics.rates import ClassRates
from kinetics.support import plots
from kinetics.support.answer import CONFIDENCE, Answer
from kinetics.support.arrays import whole_number
from kinetics.support.cli.progress import stage
from kinetics.support.datasets import dataframe
from kinetics.support.packages import pd
from kinetics.support.shown import ResultTable, Shown, Tabular, on_axes
from kinetics.support.tables import text_table

MAX_JOINS = 8  # shown to people; the rest is in `pathways`


@dataclass(frozen=True, eq=False, repr=False)
class Ranking(Shown, Tabular):
    """Rule books of one target in order, the best first.

    by : `yield`, the targets at the horizon over those possible, or `first`, the mean time to the first target, where
        runs without one by the horizon count as the horizon
    cubes, possible, horizon : number of free cubes at time 0, number of targets they could make, and horizon, tu
    notes : what a reader must know about the figures
    draws : number of draws of the rates; 0 if no rate has evidence
    unfinished : books not reached before Ctrl-C

    >>> from kinetics import ClassRates, rank
    >>> from kinetics.assembly import RuleBook
    >>> ranking = rank([RuleBook.load("line4")], ClassRates.uniform(join=1e-3), cubes=8, horizon=500.0)
    >>> ranking.possible, ranking.pathways["line4"], round(ranking.books[0].answer("yield").value, 4)
    (2, ('1+1', '1+2', '1+3', '2+2'), 0.6834)
    """

    books: tuple[RankedBook, ...]
    by: Measure
    cubes: int
    possible: int
    horizon: float
    runs: int
    seed: int
    draws: int
    max_states: int
    notes: tuple[str, ...] = ()
    unfinished: tuple[str, ...] = ()

    def are_tied(self, a: RankedBook, b: RankedBook) -> bool:
        """Whether the difference of two books lies within its own 95 % interval.

        With draws of the rates, the interval is that of the differences draw by draw; otherwise it is that of two
        independent means, from the sides of their intervals that face each other (Zou & Donner 2008). Bounds of exact
        figures add up.
        """
        if self.draws:
            column = MEASURES.index(self.by)
            low, high = np.quantile(a.drawn[:, column] - b.drawn[:, column], LIMITS)
            return bool(low <= 0 <= high)
        less, more = sorted((a.answer(self.by), b.answer(self.by)), key=lambda answer: answer.value)
        reaches = (less.high - less.value, more.value - more.low)
        is_exact = CONFIDENCE not in (less.kind, more.kind)
        return bool(more.value - less.value <= (sum(reaches) if is_exact else np.hypot(*reaches)))

    @property
    def places(self) -> tuple[int, ...]:
        """Places such as 1, 1, 3: a book shares the place of the first place leader before it that it ties with."""
        places: list[int] = []
        for number, candidate in enumerate(self.books):
            leads = places[-1] if places and self.are_tied(self.books[places[-1] - 1], candidate) else number + 1
            places.append(leads)
        return tuple(places)

    def ties_of(self, name: str) -> tuple[str, ...]:
        """Names of the other books that cannot be distinguished from this one."""
        found = [candidate for candidate in self.books if candidate.name == name]
        if not found:
            raise ValueError(f"unknown book {name!r}; ranked are {', '.join(c.name for c in self.books)}")
        return tuple(c.name for c in self.books if c is not found[0] and self.are_tied(found[0], c))

    @property
    def pathways(self) -> dict[str, tuple[str, ...]]:
        """Book -> the pairs of sizes that it joins."""
        return {candidate.name: candidate.pathway for candidate in self.books}

    @property
    def headline(self) -> str:
        """Which book is best, of how many, and by what."""
        best = f"best {self.books[0].name}" if self.books else "none finished"
        return f"{len(self.books)} rule books by {self.by}, {self.cubes} cubes until {self.horizon:g} tu: {best}"

    def summary(self) -> ResultTable:
        """A table with a row per book, and notes on the figures."""
        titles = ("", "book", "joins", "letters", "yield", "first (tu)", "reached", "CPU (s)")
        rows = []
        for place, candidate in zip(self.places, self.books, strict=True):
            result = candidate.result
            rows.append(
                (
                    f"{place}{'=' if self.places.count(place) > 1 else ''}",
                    candidate.name,
                    _short(candidate.pathway),
                    str(candidate.letters),
                    _cell(result.yield_, candidate.from_rates("yield"), result.yield_sd),
                    _cell(result.first, candidate.from_rates("first"), result.first_sd),
                    _cell(result.reached, None),
                    f"{candidate.cpu_seconds:.2g}",
                )
            )
        return ResultTable(self.headline, titles, rows, self._legend())

    def table(self) -> str:
        """The table for a terminal, without the headline."""
        table = self.summary()
        return "\n".join([text_table(table.titles, table.rows), *table.notes])

    def _legend(self) -> list[str]:
        lines = [
            f"{self.cubes} cubes, ranked by {self.by}",
            f"yield: targets at {self.horizon:g} tu over the {self.possible} possible",
            f"first: mean time to the first target, {self.horizon:g} in runs without one; reached: share with one",
            "value (sd of a run), solved on so many states, or ± 95 % confidence from so many runs"
            + ("; []: 95 % from the rates" if self.draws else ""),
        ]
        places = {candidate.name: place for candidate, place in zip(self.books, self.places, strict=True)}
        if len(set(places.values())) < len(places):
            lines.append(f"= books whose {self.by} cannot be distinguished from the first of that rank")
        for name, place in places.items():
            ties = [other for other in self.ties_of(name) if places[other] < place]
            if ties:
                lines.append(f"{name} cannot be distinguished from {', '.join(ties)} either")
        if self.unfinished:
            lines.append(f"interrupted before {', '.join(self.unfinished)}")
        return [*lines, *self.notes]

    def __str__(self) -> str:
        return self.table()

    def as_dict(self) -> dict[str, Any]:
        """The whole ranking in types that JSON can hold."""
        return {
            "by": self.by,
            "cubes": self.cubes,
            "possible": self.possible,
            "horizon": self.horizon,
            "runs": self.runs,
            "seed": self.seed,
            "draws": self.draws,
            "max_states": self.max_states,
            "pathways": {name: list(joins) for name, joins in self.pathways.items()},
            "books": [
                {
                    "place": place,
                    "book": candidate.name,
                    "ties": list(self.ties_of(candidate.name)),
                    "letters": candidate.letters,
                    "rules": candidate.rules,
                    **_plain(candidate),
                    "cpu_seconds": candidate.cpu_seconds,
                }
                for place, candidate in zip(self.places, self.books, strict=True)
            ],
            "notes": list(self.notes),
            "unfinished": list(self.unfinished),
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per book and figure."""
        rows = [
            {"place": book["place"], "book": book["book"], "joins": ", ".join(self.pathways[book["book"]])}
            | {"figure": name, **{key: value for key, value in book[name].items() if key != "from_rates"}}
            | dict(zip(("rates_low", "rates_high"), book[name].get("from_rates") or (None, None), strict=True))
            for book in self.as_dict()["books"]
            for name in ("yield", "first", "reached")
        ]
        return dataframe(rows)

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Plot yield against time to the first target, each book a point with 95 % intervals; returns `ax`.

        The first eight have a colour and a name each; the others are grey.
        """
        shown = min(len(self.books), len(plots.COLOURS))
        for number, candidate in enumerate(self.books):
            spans = {measure: _span(candidate, measure) for measure in MEASURES}
            first, amount = (candidate.answer(measure) for measure in ("first", "yield"))
            is_exact = CONFIDENCE not in (first.kind, amount.kind)
            colour = plots.colour(number) if number < shown else "0.6"
            label = f"{candidate.name}: {_short(candidate.pathway)}" if number < shown else ""
            ax.errorbar(
                first.value,
                amount.value,
                xerr=[[span] for span in spans["first"]],
                yerr=[[span] for span in spans["yield"]],
                marker="osD^vP*X"[number] if number < shown else ".",
                markersize=7,
                color=colour,
                markerfacecolor=colour if is_exact else "white",
                capsize=3,
                linestyle="none",
                label=label or (f"{len(self.books) - shown} more" if number == shown else None),
                zorder=3 if number < shown else 2,
            )
        ax.set_xlabel("mean time to the first target (tu)")
        ax.set_ylabel(f"yield at {self.horizon:g} tu")
        ax.set_xlim(left=0)
        ax.set_ylim(-0.02, 1.02)  # whole markers at both ends
        how = "filled: exact; open: sampled; bars: 95 %" + (", rates included" if self.draws else "")
        ax.legend(frameon=False, fontsize="small", title=how, title_fontsize="small")
        return ax


def rank(
    books: Sequence[RuleBook],
    rates: ClassRates,
    cubes: int = 60,
    horizon: float = 2000.0,
    by: Measure = "yield",
    runs: int = 1000,
    seed: int = 0,
    draws: int = 0,
    max_states: int = MAX_STATES,
    progress: Callable[[str], None] | None = None,
) -> Ranking:
    """Rank correct books of one target, started from free cubes (and the seed, where a book has one).

    runs : number of runs for a figure whose chain has more than `max_states` states or takes too long to solve
    draws : number of sets of rates drawn from their evidence, each with `RUNS_PER_DRAW` runs where it must be sampled
    progress : called with the name of the book that is being worked on
    ValueError: books of several targets or names that are not unique, too few cubes, or a class without a rate

    The figures of a book depend on the book and the seed, not on the other books. After Ctrl-C the ranking holds the
    books that were finished, if any.

    >>> from kinetics import ClassRates, rank
    >>> from kinetics.assembly import RuleBook
    >>> books = [RuleBook.load("line4"), RuleBook.load("line4_pairs")]
    >>> ranking = rank(books, ClassRates.uniform(join=1e-3), cubes=8, horizon=500.0)
    >>> [book.name for book in ranking.books], ranking.places
    (['line4_pairs', 'line4'], (1, 2))
    """
    _check(books, cubes, horizon, by)
    whole_number("runs", runs, 2)
    whole_number("seed", seed, 0)
    if draws:
        whole_number("draws", draws, 2)
    derivations = [derived(book) for book in books]
    for one in derivations:
        rates.apply(one)  # a class without a rate is refused before any work
    bare = rates.without_evidence([c for one in derivations for c in one.rate_classes])
    used = {rates.key(c) for one in derivations for c in one.rate_classes}
    sequence = np.random.SeedSequence(seed, spawn_key=(1,))
    # Draws of rates that are all taken as known would differ by nothing but noise.
    drawn = rates.draws(np.random.default_rng(sequence), draws) if draws and len(bare) < len(used) else []
    notes = (f"the rates' intervals exclude {', '.join(bare)}: taken as exact, because without evidence",)
    finished: list[RankedBook] = []
    try:
        for number, one in enumerate(derivations, 1):
            text = f"{one.book.name}, {number} of {len(derivations)}"
            if progress is not None:
                progress(text)
            stage(text, (number - 1) / len(derivations))
            finished.append(ranked_book(one, rates, drawn, cubes, horizon, runs, seed, max_states))
    except KeyboardInterrupt:
        if not finished:
            raise
    sign = -1 if by == "yield" else 1
    finished.sort(key=lambda c: (sign * c.answer(by).value, c.name))
    names = {candidate.name for candidate in finished}
    return Ranking(
        tuple(finished),
        by,
        cubes,
        possible_targets(derivations[0].book, cubes),
        horizon,
        runs,
        seed,
        len(drawn),
        max_states,
        notes if draws and bare else (),
        tuple(book.name for book in books if book.name not in names),
    )


def _check(books: Sequence[RuleBook], cubes: int, horizon: float, by: str) -> None:
    """The books are several, have names of their own and one target, which the cubes suffice for."""
    if not books:
        raise ValueError("no books to rank; give at least one")
    if by not in MEASURES:
        raise ValueError(f"by = {by!r}; expected one of {', '.join(MEASURES)}")
    if not 0 < horizon < np.inf:
        raise ValueError(f"horizon = {horizon:g}; expected a positive number of tu")
    names = [book.name for book in books]
    doubled = {name for name in names if names.count(name) > 1}
    if doubled:
        raise ValueError(f"two books are called {min(doubled)!r}; give each a name of its own")
    shapes = [target_shape(book) for book in books]
    for book, shape in zip(books, shapes, strict=True):
        if shape != shapes[0]:
            raise ValueError(
                f"books {books[0].name!r} and {book.name!r} make different targets; rank books of one target"
            )
    if len({book.seed_letter is None for book in books}) > 1:
        raise ValueError("some of these books grow one target from a seed, others many without; rank them separately")
    whole_number("cubes", cubes, 1)
    if possible_targets(books[0], cubes) == 0:
        raise ValueError(f"{cubes} cubes do not suffice for a target of {len(shapes[0])}; give more")


def _span(candidate: RankedBook, measure: Measure) -> tuple[float, float]:
    """How far the 95 % interval reaches below and above the point, the rates' included where there is one."""
    answer = candidate.answer(measure)
    low, high = candidate.from_rates(measure) or (answer.low, answer.high)
    return max(answer.value - low, 0.0), max(high - answer.value, 0.0)


def _plain(candidate: RankedBook) -> Mapping[str, Any]:
    found = candidate.result
    spread = {"yield": found.yield_sd, "first": found.first_sd}
    return {
        name: candidate.answer(name).to_dict() | {"sd": spread[name], "from_rates": candidate.from_rates(name)}
        for name in MEASURES
    } | {"reached": found.reached.to_dict()}


def _short(pathway: tuple[str, ...]) -> str:
    """`1+1, 1+2, 2+2`; of a long one the beginning."""
    shown = ", ".join(pathway[:MAX_JOINS])
    return shown if len(pathway) <= MAX_JOINS else f"{shown} and {len(pathway) - MAX_JOINS} more"


def _cell(answer: Answer, from_rates: tuple[float, float] | None, sd: float | None = None) -> str:
    """`0.6260 (0.12), 1906 states` or `0.538 ± 0.008 (0.13), 1000 runs`, with the interval from the rates."""
    error = f" ± {answer.error:.2g}" if answer.kind == CONFIDENCE else ""
    spread = "" if sd is None else f" ({sd:.2g})"
    rates = "" if from_rates is None else f" [{from_rates[0]:.4g}, {from_rates[1]:.4g}]"
    return f"{answer.value:.4g}{error}{spread}, {answer.why}{rates}"
