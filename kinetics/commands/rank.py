"""`wellmixed rules rank`: correct rule books of one target, ordered by yield or first-assembly time."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinetics.assembly import RuleBook, derive
from kinetics.assembly.rules.writing import written
from kinetics.predicting.ranking import ranking
from kinetics.rates import ClassRates
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option, default_option
from kinetics.support.cli.failures import INTERRUPTED
from kinetics.support.cli.options import (
    budget_option,
    csv_option,
    echo_json,
    in_a_folder,
    json_option,
    plot_option,
    seed_option,
    write_plots,
    write_tables,
)
from kinetics.support.cli.progress import progress_line
from kinetics.support.output import write_whole

if TYPE_CHECKING:
    from kinetics.assembly import RuleBook
    from kinetics.rates import ClassRates


@click.command()
@click.argument("books", metavar="BOOK...|TARGET.toml", nargs=-1, required=True, shell_complete=shipped("book"))
@click.option(
    "--rates",
    "rates_name",
    metavar="NAME|FILE",
    shell_complete=shipped("rates"),
    help="Rates of a book's network (such as table3), or a .toml file of rates by class.",
)
@click.option(
    "--rates-book",
    metavar="BOOK",
    help="The book whose network --rates belongs to.  [default: a ranked book that fits]",
)
@click.option("--join", type=float, metavar="K", help="Instead of --rates: one rate constant for every join, 1/tu.")
@click.option(
    "--break",
    "break_",
    type=float,
    metavar="K",
    help="With --join: one rate constant for every break, 1/tu.  [default: 0]",
)
@default_option(
    "--by", type=click.Choice(["yield", "first"]), default="yield", help="Rank by yield or by first-assembly time."
)
@count_option("--cubes", default=60, help="Number of free cubes at time 0.")
@default_option("--horizon", metavar="T", type=float, default=2000.0, help="Time at which the yield is taken, tu.")
@count_option("--runs", least=2, default=1000, help="Number of runs for a book that is sampled.")
@count_option(
    "--posterior-draws",
    "draws",
    least=0,
    default=0,
    help="Number of draws of the rates, to account for their uncertainty.",
)
@count_option(
    "--max-states", least=0, default=100_000, help="Books with more states than this are sampled, not solved."
)
@default_option(
    "--time-limit",
    metavar="SECONDS",
    type=float,
    default=20.0,
    help="Wall time for compiling the books of a target, s.",
)
@click.option(
    "--best", "best_file", metavar="FILE", callback=in_a_folder, help="Write the best book to this TOML file."
)
@csv_option
@plot_option
@budget_option
@seed_option
@json_option
def rank(
    books: tuple[str, ...],
    rates_name: str | None,
    rates_book: str | None,
    join: float | None,
    break_: float | None,
    by: str,
    cubes: int,
    horizon: float,
    runs: int,
    draws: int,
    max_states: int,
    time_limit: float,
    best_file: str | None,
    csv_files: tuple[str, ...],
    plot_files: tuple[str, ...],
    budget: float,
    seed: int,
    as_json: bool,
) -> None:
    """Rank correct rule books of one target by yield or first-assembly time.

    For a TARGET.toml, as read by `rules compile`, the books are compiled first: one for each choice of joins that leads
    to the target, fewest joins first, until the time limit.

    The report gives the expected yield at the horizon and the mean time to the first target, each with its error:
    solved exactly if the states are few enough, sampled otherwise. Books that differ by less than their errors share a
    rank.
    """
    with progress_line(budget=budget) as progress:
        loaded, notes = _books(books, time_limit, progress)
        rates = _rates(rates_name, rates_book, join, break_, loaded)
        made = ranking.rank(loaded, rates, cubes, horizon, by, runs, seed, draws, max_states, progress)  # type: ignore[arg-type]
    made = replace(made, notes=(*notes, *made.notes))
    if best_file:
        best = made.books[0].name
        write_whole(best_file, written(next(book for book in loaded if book.name == best)))
    write_tables(csv_files, made.to_dataframe)
    write_plots(plot_files, made.plot)
    if as_json:
        echo_json({"rates": rates.as_dict(without={"evidence"}, none=False), **made.as_dict()})
    else:
        click.echo(str(made))
    if made.unfinished:
        raise SystemExit(INTERRUPTED)


def _books(
    names: Sequence[str], time_limit: float, progress: Callable[[str], None]
) -> tuple[list[RuleBook], list[str]]:
    """The books, those of a target compiled, and notes on these; files of one name are called by their paths."""
    loaded: list[tuple[str, RuleBook]] = []
    notes: list[str] = []
    for name in names:
        if _is_target(name):
            compiled, note = _compiled(name, time_limit, progress)
            loaded += [(book.name, book) for book in compiled]
            notes.append(note)
        else:
            loaded.append((name, RuleBook.load(name)))
    counts = Counter(book.name for _, book in loaded)
    return [replace(book, name=name) if counts[book.name] > 1 else book for name, book in loaded], notes


def _is_target(name: str) -> bool:
    """True if a file describes a target."""
    from kinetics.assembly.compiler.target import describes_target

    path = Path(name)
    return path.suffix == ".toml" and path.is_file() and describes_target(path)


def _compiled(name: str, time_limit: float, progress: Callable[[str], None]) -> tuple[list[RuleBook], str]:
    """One book for each choice of joins, `t5-1`, `t5-2` and on, and how the search ended."""
    from kinetics.assembly.compiler import Target, all_books

    target = Target.load(name)
    began = time.monotonic()
    books: list[RuleBook] = []
    ended = ""
    try:
        for found in all_books(target, time_limit=time_limit, progress=progress):
            books.append(replace(found.book, name=f"{target.name}-{len(books) + 1}"))
    except KeyboardInterrupt:
        ended = "interrupted"
        if not books:
            raise
    if time.monotonic() - began >= time_limit:
        ended = f"stopped after {time_limit:g} s"
    if not books:
        raise ValueError(
            f"no book of target {target.name!r}: {ended or 'there is none'}; see `wellmixed rules compile`"
        )
    count = f"{len(books)} book{'' if len(books) == 1 else 's'} compiled of target {target.name!r}"
    if ended:
        return books, f"{count}, then {ended}: there may be more"
    return books, f"{count}: all choices of joins for which one was found"


def _rates(
    name: str | None, of_book: str | None, join: float | None, break_: float | None, books: Sequence[RuleBook]
) -> ClassRates:

    if (name is None) == (join is None):
        raise ValueError("give the rates by either --rates table3 or --join 7e-5 --break 3e-5")
    if join is not None:
        if of_book is not None:
            raise ValueError("--rates-book goes with --rates, not with --join")
        return ClassRates.uniform(join, break_ or 0.0)
    if break_ is not None:
        raise ValueError("--break goes with --join; with --rates, breaks have their rates from the file")
    owners = books if of_book is None else [RuleBook.load(of_book)]
    try:
        return ClassRates.fitting(name or "", map(derive, owners))
    except ValueError as error:
        if of_book is None and "network of another book" in str(error):
            raise ValueError(f"{error}. Say which book by --rates-book") from None
        raise
