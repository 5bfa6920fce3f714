"""`wellmixed calibrate --events`: rates from tables of observed events."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from calibration.commands.shared import given_options
from kinetics.commands.models import is_network_file, network_of_book
from kinetics.network import Tank

if TYPE_CHECKING:
    from calibration.observed.study import ObservedStudy

# Options that mean something with --events too; all others tell how mechanics runs are made.
SHARED = {"scene", "out", "cubes", "report", "as_json", "events", "run_table", "tank", "breaks"}


def events_options(command: Callable[..., None]) -> Callable[..., None]:
    """--events, --run-table and --tank."""
    table = click.Path(exists=True, dir_okay=False)
    for option in (
        click.option(
            "--tank",
            metavar="X Y Z",
            type=float,
            nargs=3,
            help="Edge lengths of the tank in which the runs of --events were observed.",
        ),
        click.option(
            "--run-table",
            metavar="FILE",
            type=table,
            help="Table of the runs of --events: run, start, end and a column for each species with its initial "
            "count. Without it, --events needs rows marked start and end.",
        ),
        click.option(
            "--events",
            metavar="FILE",
            type=table,
            help="Make no runs; read a table (CSV or Parquet) of what others observed: run, time and channel, or run, "
            "time and the counts after each change, a column for each species.",
        ),
    ):
        command = option(command)
    return command


def study_of_events(
    source: str,
    events: str | None,
    run_table: str | None,
    tank: tuple[float, float, float] | None,
    cubes: tuple[int, ...],
    breaks: str | None,
) -> ObservedStudy | None:
    """The study that --events asks for, None without it. ValueError: options that do not go together.

    cubes : taken as the number that each run holds if the user has said so
    breaks : name of a break model, or `auto`; None: rates of breaks as they were counted
    """
    given = given_options()
    if events is None:
        for name in ("run_table", "tank"):
            if name in given:
                raise ValueError(f"{given[name]} describes observed runs; name their table too, by --events")
        return None
    for name, option in given.items():
        if name not in SHARED:
            raise ValueError(f"{option} applies to mechanics runs, and --events makes none; leave one of them out")
    from calibration.observed.study import observed_study
    from kinetics.formats import read

    network, single = (read(source).network, None) if is_network_file(source) else network_of_book(source)
    if "cubes" in given and len(cubes) > 1:
        raise ValueError(
            f"--cubes {' '.join(map(str, cubes))}: with --events one number, that of the cubes in each run"
        )
    said = cubes[0] if "cubes" in given else None
    return observed_study(
        source, network, events, run_table, cubes=said, single=single, tank=tank and Tank(tank), breaks=breaks
    )
