"""`wellmixed rules rank`."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from kinetics.options import csv_option, echo_json, json_option, plot_option, seed_option

if TYPE_CHECKING:
    from kinetics.assembly import RuleBook
    from kinetics.classrates import ClassRates

INTERRUPTED = 130  # exit code


@click.command()
@click.argument("books", nargs=-1, required=True)
@click.option("--rates", "rates_name", metavar="NAME|FILE", help="Rates of a book's network (table3), or by class.")
@click.option("--rates-book", metavar="BOOK", help="Whose network they are of.  [default: a ranked one that fits]")
@click.option("--join", type=float, metavar="K", help="Instead: one rate constant for every join, 1/tu.")
@click.option("--break", "break_", type=float, metavar="K", help="With --join: one for every break.  [default: 0]")
@click.option("--by", type=click.Choice(["yield", "first"]), default="yield", show_default=True)
@click.option("--cubes", type=click.IntRange(min=1), default=60, show_default=True, help="Free cubes at time 0.")
@click.option("--horizon", type=float, default=2000.0, show_default=True, help="When the yield is taken, tu.")
@click.option("--runs", type=click.IntRange(min=2), default=1000, show_default=True, help="Where it has to be sampled.")
@click.option(
    "--draws", type=click.IntRange(min=0), default=0, show_default=True, help="Of the rates, for their uncertainty."
)
@click.option(
    "--max-states", type=click.IntRange(min=0), default=100_000, show_default=True, help="Solved exactly up to these."
)
@csv_option
@plot_option
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
    csv_file: str | None,
    plot_file: str | None,
    seed: int,
    as_json: bool,
) -> None:
    """Rank correct rule BOOKS of one target by what their tanks come to.

    The expected yield at the horizon and the mean time to the first target: exact where the states are few enough,
    sampled beyond, each with its error. Books that the figures cannot tell apart share a place.
    """
    from kinetics import ranking

    loaded = _named_apart(books)
    rates = _rates(rates_name, rates_book, join, break_, loaded)
    shows = sys.stderr.isatty()

    def progress(name: str) -> None:
        if shows:
            click.echo(f"\r\033[K{name}", err=True, nl=False)

    made = ranking.rank(loaded, rates, cubes, horizon, by, runs, seed, draws, max_states, progress)  # type: ignore[arg-type]
    if shows:
        click.echo("\r\033[K", err=True, nl=False)
    if csv_file:
        made.to_dataframe().to_csv(csv_file, index=False)
    if plot_file:
        from kinetics import plots

        plots.save(plot_file, made.plot)
    if as_json:
        echo_json({"rates": rates.model_dump(exclude_none=True, exclude={"evidence"}), **made.as_dict()})
    else:
        click.echo(str(made))
    if made.unfinished:
        raise SystemExit(INTERRUPTED)


def _named_apart(names: Sequence[str]) -> list[RuleBook]:
    """The books; files of one name are called by their paths."""
    from kinetics.assembly import RuleBook

    loaded = [RuleBook.load(name) for name in names]
    counts = Counter(book.name for book in loaded)
    return [
        replace(book, name=name) if counts[book.name] > 1 else book for name, book in zip(names, loaded, strict=True)
    ]


def _rates(
    name: str | None, of_book: str | None, join: float | None, break_: float | None, books: Sequence[RuleBook]
) -> ClassRates:
    from kinetics.assembly import RuleBook, derive
    from kinetics.classrates import ClassRates

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
        if of_book is None and "not here" in str(error):
            raise ValueError(f"{error}. Say which book by --rates-book") from None
        raise
