"""`wellmixed rules grow`: stochastic simulation of assembly directly from the rules."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from kinetics.assembly import RuleBook
from kinetics.assembly.drawing.pictures import strip
from kinetics.networkfree import grow as make
from kinetics.rates import ClassRates
from kinetics.runs.truncation import TruncatedRunsError, Truncation
from kinetics.sampling.watch import MAX_EVENTS
from kinetics.support.arrays import Floats
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option, files_option
from kinetics.support.cli.failures import INCOMPLETE, INTERRUPTED
from kinetics.support.cli.options import (
    NumbersCommand,
    budget_option,
    csv_option,
    echo_json,
    json_option,
    picture_of,
    plot_option,
    seed_option,
    time_grid,
    write_plots,
    write_tables,
)
from kinetics.support.cli.progress import progress_line
from kinetics.support.tables import text_table, with_spread

if TYPE_CHECKING:
    from kinetics.assembly import RuleBook, Structure
    from kinetics.networkfree import Growths
    from kinetics.rates import ClassRates

MAX_ROWS = 11  # of a table for people; --json and --csv give every time
MAX_FINAL = 50  # structures in JSON
SHOWN_FINAL = 5  # for people
MAX_WIDTH = 100  # of a structure as text
FRAMES = 8  # of a strip


@click.command(cls=NumbersCommand)
@click.argument("book", shell_complete=shipped("book"))
@count_option("--cubes", required=True, help="Number of free cubes at time 0, not counting the seed.")
@count_option("--seeds", help="Number of seeds at time 0, for a book that grows from a seed.  [default: 1]")
@click.option("--rates", "rates_file", metavar="FILE", help="Rates by class: a .toml file.")
@count_option(
    "--posterior-draws",
    "draws",
    help="With --rates: spread the runs over this many draws of the rates from their posterior.  [default: none]",
)
@click.option(
    "--join",
    metavar="K",
    type=float,
    help="Instead of --rates: one rate constant for every pair of faces that may bond, 1/tu.",
)
@click.option(
    "--break",
    "break_",
    metavar="K",
    type=float,
    help="With --join: one rate constant for the breaking of every bond, 1/tu.  [default: 0]",
)
@click.option("--duration", metavar="T", type=float, help="Simulated time, tu.  [default: 2000]")
@click.option("--times", type=float, multiple=True, metavar="T ...", help="Report at these times instead, tu.")
@count_option("--runs", default=20, help="Number of independent runs.")
@count_option(
    "--max-events",
    default=MAX_EVENTS,
    help="Maximum number of events in a run; results end where a run would exceed it.",
)
@files_option(
    "--strip",
    "strips",
    callback=picture_of,
    help="Draw the growth of the first run as a strip of pictures: PNG, PDF or SVG; may be repeated.",
)
@csv_option
@plot_option
@budget_option
@seed_option
@json_option
def grow(
    book: str,
    cubes: int,
    seeds: int | None,
    rates_file: str | None,
    draws: int | None,
    join: float | None,
    break_: float | None,
    duration: float | None,
    times: tuple[float, ...],
    runs: int,
    max_events: int,
    strips: tuple[str, ...],
    csv_files: tuple[str, ...],
    plot_files: tuple[str, ...],
    budget: float,
    seed: int,
    as_json: bool,
) -> None:
    """Simulate assembly event by event, directly from the rules of BOOK, without deriving its reaction network.

    The simulation is statistically exact, as sampling in `predict` is, and works for books that can assemble any number
    of structures. Rates by class come from `calibrate` and are described in docs/class_rates.md. It reports mean and
    standard deviation over the runs. Ctrl-C keeps the runs that are finished. Exit code 4: a run was truncated, and
    there are fewer times than requested.
    """
    began = time.process_time()
    rules = RuleBook.load(book)
    rates = _rates(rates_file, join, break_)
    grid = time_grid(duration, times)
    if draws is not None and rates_file is None:
        raise ValueError(
            f"--posterior-draws {draws}: only a file of rates has evidence to draw from; give --rates, or leave it out"
        )
    end = float(np.max(grid))
    with progress_line(budget=budget):
        made = make(rules, rates, _start(rules, cubes, seeds), end, runs, seed, draws=draws or 0, max_events=max_events)
    truncated = _truncation(made, grid, max_events) if made.truncated else None
    if truncated is not None:
        if truncated.until is None:
            raise TruncatedRunsError(truncated)
        grid = grid[grid <= truncated.until]
    cpu_seconds = time.process_time() - began
    write_tables(csv_files, lambda: made.to_dataframe(grid))
    write_plots(plot_files, lambda ax: made.plot(ax, grid))
    for file in strips:
        moments = made.runs[0].milestones(FRAMES)
        captions = [f"{moment:.4g} tu" for moment in moments]
        strip(made.runs[0].frames(moments), captions, rules.scheme).save(file)
    if as_json:
        asked = {"book": book, "cubes": cubes, "seeds": seeds, "seed": seed, "draws_of_rates": draws}
        told = {"truncated": None if truncated is None else truncated.to_dict(), "cpu_seconds": cpu_seconds}
        echo_json(asked | _as_data(made, grid) | told)
    else:
        click.echo(_table(made, grid))
        click.echo("\n".join([*_notes(made, cpu_seconds), *([] if truncated is None else [str(truncated)])]))
    if made.interrupted:
        click.echo(
            f"Interrupted: {len(made.runs)} of {runs} runs were finished, and only these are reported.", err=True
        )
        raise SystemExit(INTERRUPTED)
    if truncated is not None:
        raise SystemExit(INCOMPLETE)


def _truncation(made: Growths, grid: Floats, most: int) -> Truncation | None:
    """The truncation of runs that reached the most events; None if they passed all times asked for before."""
    ends = np.array(made.truncated)
    first, known = int(np.argmin(ends)), np.sort(grid)
    later = known[known > ends[first]]
    if not later.size:
        return None
    before = known[known <= ends[first]]
    return Truncation(
        time=float(ends[first]),
        run=first,
        truncated=int((ends < later[0]).sum()),
        among=len(ends),
        until=float(before[-1]) if before.size else None,
        beyond=float(later[0]),
        end=float(known[-1]),
        channel="",
        propensity=0.0,
        reason="events",
        events=float(most),
        max_events=most,
        time_unit="tu",
    )


def _start(rules: RuleBook, cubes: int, seeds: int | None) -> int | dict[Structure, int]:
    """The contents of the tank at time 0."""
    if seeds is None:
        return cubes
    seed = rules.seed()
    if seed is None:
        raise ValueError(f"--seeds {seeds}: book {rules.name!r} grows without a seed; leave it out")
    return {rules.monomer(): cubes, seed: seeds}


def _rates(rates_file: str | None, join: float | None, break_: float | None) -> ClassRates:

    if rates_file is not None and join is None and break_ is None:
        return ClassRates.load(rates_file)
    if rates_file is None and join is not None:
        return ClassRates.uniform(join, break_ or 0.0)
    raise ValueError("say how fast faces bond by either --rates FILE, or --join 7e-5 with or without --break 1e-3")


def _as_data(made: Growths, grid: Floats) -> dict[str, Any]:
    final = made.final()
    listed = list(final.items())[:MAX_FINAL]
    data: dict[str, Any] = {
        "runs": len(made.runs),
        "interrupted": made.interrupted,
        "times": grid,
        "series": {
            name: {
                "mean": values.mean(axis=0),
                "sd": _sd(values),
                "low": np.quantile(values, 0.025, axis=0, method="inverted_cdf"),
                "high": np.quantile(values, 0.975, axis=0, method="inverted_cdf"),
            }
            for name, values in made.series(grid).items()
        },
        "final": [{"structure": str(s), "cubes": len(s), "mean_copies": copies} for s, copies in listed],
        "final_left_out": len(final) - len(listed),
        "structures_met": _met(made),
        "events": sum(run.times.size for run in made.runs),
        "draws": sum(run.draws for run in made.runs),
    }
    if made.target is not None:
        first = made.first_times(made.target)
        data["target"] = {"reached": int(np.isfinite(first).sum()), "first_times": first.tolist()}
    return data


def _met(made: Growths) -> int:
    """How many different structures came up in all runs together."""
    return len({structure for run in made.runs for structure in run.structures})


def _sd(values: np.ndarray) -> Floats:
    """Standard deviation among the runs; nan for a single one."""
    return values.std(axis=0, ddof=1) if len(values) > 1 else np.full(values.shape[1], np.nan)


def _table(made: Growths, grid: Floats) -> str:
    """Mean and sd at some of the times."""
    step = max(1, -(-(grid.size - 1) // (MAX_ROWS - 1))) if grid.size > MAX_ROWS else 1
    series = made.series(grid)
    spread = {name: (values.mean(axis=0), _sd(values)) for name, values in series.items()}
    rows = [
        [f"{grid[i]:g}", *(with_spread(mean[i], sd[i]) for mean, sd in spread.values())]
        for i in range(0, grid.size, step)
    ]
    return text_table(("time (tu)", *series), rows)


def _notes(made: Growths, cpu_seconds: float) -> list[str]:
    """Notes below the table: its meaning, the target's yield, how runs ended, and their cost."""
    n, events = len(made.runs), sum(run.times.size for run in made.runs)
    draws = sum(run.draws for run in made.runs)
    what = "mean ± sd of a run" if n > 1 else "of a single run, which has no spread"
    notes = [f"{what}: structures by their number of cubes, and the size of the largest"]
    if made.target is not None:
        first = made.first_times(made.target)
        reached = int(np.isfinite(first).sum())
        text = f"target reached in {reached} of {n} runs"
        if reached == n > 1:
            text += f", first after {first.mean():.4g} ± {first.std(ddof=1) / np.sqrt(n):.2g} tu (standard error)"
        notes.append(text)
    final = made.final()
    notes.append(f"the runs end with {len(final)} different structures; most cubes are in")
    for structure, copies in list(final.items())[:SHOWN_FINAL]:
        words = str(structure)
        words = words if len(words) <= MAX_WIDTH else words[: MAX_WIDTH - 3] + "..."
        notes.append(f"  {copies:8.4g} a run, size {len(structure)}: {words}")
    notes.append(
        f"{n} runs, {_met(made)} structures met, {events} events, {draws / max(events, 1):.2f} draws an event, "
        f"{cpu_seconds:.2g} s CPU"
    )
    return notes
