"""`wellmixed rules compile`: a rule book that builds a target structure and nothing else."""

from __future__ import annotations

import json
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import click

from kinetics.assembly import Senses
from kinetics.assembly.compiler import Target, compile_book
from kinetics.assembly.compiler.yields import CONDITIONS
from kinetics.assembly.rules.writing import written
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import POSITIVE, count_option, default_option
from kinetics.support.cli.options import echo_json, in_a_folder, json_option, seed_option
from kinetics.support.cli.progress import progress_line
from kinetics.support.output import write_whole

ENDING = 0.5  # of the time that the process took to start: what it takes to end


def time_since_start() -> float:
    """Wall time since the process began that was started for this command, s; 0 if it was called from Python.

    Where no /proc tells it, the CPU time that was used, which is not more.
    """
    if sys.argv[1:3] != ["rules", "compile"]:
        return 0.0
    try:
        ticks = int(Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, AttributeError):
        return time.process_time()


@click.command()
@click.argument("target", shell_complete=shipped("target"))
@click.option("--out", metavar="FILE", callback=in_a_folder, help="Write the rule book to this TOML file.")
@click.option(
    "--faces", type=click.Choice(["one", "two", "six"]), help="Number of face types that a cube distinguishes."
)
@click.option("--roll", is_flag=True, help="Cubes sense the twist at which another cube docks.")
@click.option("--across", is_flag=True, help="Cubes sense the letter at the face opposite the docking face.")
@click.option("--touched", is_flag=True, help="Cubes sense the letters of all cubes they touch on docking.")
@click.option(
    "--joins",
    metavar="JOIN,...",
    help="Joins of the book, such as 1+1,1+2 or 2.a+1->3.b.  [default: of those with the fewest letters, the largest "
    "yield]",
)
@click.option("--breaks/--no-breaks", default=None, help="Whether bonds can break.  [default: as the target says]")
@count_option(
    "--max-letters", least=2, help="Largest number of letters (states of a cube).  [default: as the target says, or 8]"
)
@default_option(
    "--time-limit",
    metavar="SECONDS",
    type=POSITIVE,
    default=600,
    help="Wall time after which the command ends, its start included, s; a book found before does not depend on it.",
)
@default_option(
    "--effort",
    metavar="FACTOR",
    type=POSITIVE,
    default=1.0,
    help="By what the usual steps of every search are multiplied: more takes longer and leaves less undecided.",
)
@click.option(
    "--certificate",
    metavar="FILE",
    callback=in_a_folder,
    help="Write what is claimed of the book to this JSON file, for `wellmixed rules certify`.",
)
@seed_option
@json_option
def compile_(
    target: str,
    out: str | None,
    faces: str | None,
    roll: bool,
    across: bool,
    touched: bool,
    joins: str | None,
    breaks: bool | None,
    max_letters: int | None,
    time_limit: float,
    effort: float,
    certificate: str | None,
    seed: int,
    as_json: bool,
) -> None:
    """Synthesise a rule book that builds TARGET (a shipped target or a .toml file) and nothing else.

    A target file draws the cubes in `layers` (# a cube, a dot for none; x, y or z a cube whose top looks along that
    axis) or lists their places as `cubes`; it may set `seed`, `senses`, `joins`, `breaks` and `max_letters`.

    The search takes the weakest sufficient senses, unless the options or the target name them, then the fewest letters,
    then the largest yield: the mean of two, with and without breaks, by the rate equations at rates that are printed.
    The book is verified before it is printed, with a report of the search, which says how much of the yield a longer
    search could gain (--effort), and with a warning if a yield is below 0.1. --seed matters only for structures that
    grow from a seed cube.
    """
    wanted = Target.load(target)
    if faces or roll or across or touched:
        asked = Senses(faces=faces or "two", roll=roll, across=across, touched=touched)
        wanted = replace(wanted, senses=asked)
    with progress_line() as progress:
        made = compile_book(
            wanted,
            joins=None if joins is None else tuple(join.strip() for join in joins.split(",")),
            breaks=breaks,
            max_letters=max_letters,
            time_limit=time_limit,
            effort=effort,
            started=time.monotonic() - (1 + ENDING) * time_since_start(),
            seed=seed,
            progress=progress,
        )
    book = made.book
    fewest = ", the fewest of their kind" if made.minimal else ""
    counts = f"{len(book.combine)} + {len(book.dissociate)} + {len(book.internal)}"
    summary = [
        f"{book.name}: {made.letters} letters{fewest}; {counts} rules for joins, breaks, and what follows",
        f"cubes sense: {made.capability}",
        *([f"joins: {', '.join(made.joins)}"] if made.joins else []),
        *([] if made.yields is None else [f"{made.yields} ({CONDITIONS})"]),
        *made.searched,
        *made.verified,
    ]
    text = written(book, "\n".join(summary))
    if certificate is not None:
        if made.certificate is None:
            raise click.UsageError("a book that grows from a seed has no certificate; leave out --certificate")
        write_whole(certificate, json.dumps(made.certificate.as_json(), indent=1) + "\n")
    if out is not None:
        write_whole(out, text)
    if as_json:
        echo_json(
            {
                "target": target,
                "book": text,
                "file": out,
                "fingerprint": book.fingerprint,
                "letters": made.letters,
                "minimal": made.minimal,
                "rules": {
                    "combine": len(book.combine),
                    "dissociate": len(book.dissociate),
                    "internal": len(book.internal),
                },
                "senses": book.senses.as_dict(),
                "joins": made.joins,
                "yields": None if made.yields is None else made.yields.as_dict(),
                "gain": made.gain,
                "searched": made.searched,
                "verified": made.verified,
                "certificate": certificate,
                "effort": effort,
                "seed": seed,
            }
        )
    elif out is None:
        click.echo(text)
    else:
        click.echo("\n".join([*summary, f"written to {out}"]))
    if made.yields is not None and made.yields.warning:
        click.echo(f"warning: {made.yields.warning}", err=True)
