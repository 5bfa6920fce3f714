"""`wellmixed rules check`: faults of a rule book, each with its shortest counterexample."""

from __future__ import annotations

import click

from kinetics.assembly import RuleBook
from kinetics.assembly import check as examine
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option, default_option
from kinetics.support.cli.failures import CHECKED, INTERRUPTED
from kinetics.support.cli.options import echo_json, json_option, plot_option
from kinetics.support.cli.progress import progress_line


@click.command()
@click.argument("book", shell_complete=shipped("book"))
@count_option(
    "--max-cubes", help="Size of the largest structure explored, cubes.  [default: 12, or the target's size if larger]"
)
@count_option("--max-species", default=2000, help="Largest number of structures explored.")
@default_option(
    "--delayed-updates/--no-delayed-updates",
    default=True,
    help="Also explore collisions that happen before the internal rules have settled.",
)
@plot_option
@json_option
def check(
    book: str,
    max_cubes: int | None,
    max_species: int,
    delayed_updates: bool,
    plot_files: tuple[str, ...],
    as_json: bool,
) -> None:
    """Verify the rule book BOOK (a shipped book or a .toml file) by exploring everything it can assemble.

    It reports off-target structures, dead ends, traps, starvation, unbounded growth, livelocks and unused rules, each
    with the shortest sequence of events that leads to it; --plot draws these. Exit code 1 if there are errors. Ctrl-C
    reports what was explored so far.
    """
    with progress_line() as progress:
        report = examine(
            *(RuleBook.load(book), max_cubes, max_species, delayed_updates),
            lambda explored, found: progress(f"{explored} of {found} explored"),
        )
    for plot_file in plot_files:
        report.drawing().save(plot_file)
    if as_json:
        echo_json(
            {
                "book": book,
                "correct": report.is_correct,
                "structures": report.n_structures,
                "events": report.n_events,
                "recoverability": report.recoverability._asdict(),
                "delayed_updates": report.waves,
                "findings": [
                    {
                        "kind": finding.kind,
                        "error": finding.is_error,
                        "text": finding.text,
                        "steps": finding.steps,
                        "structure": None if finding.structure is None else str(finding.structure),
                    }
                    for finding in report.findings
                ],
                **({"plot": plot_files[0]} if plot_files else {}),
            }
        )
    else:
        click.echo(str(report))
    if not report.is_correct:
        is_part = any(finding.text.startswith("interrupted") for finding in report.findings)
        raise SystemExit(INTERRUPTED if is_part else CHECKED)
