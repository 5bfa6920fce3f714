"""Calibration from what others observed: the same estimates, diagnostics and rates file as from mechanics runs."""

from __future__ import annotations

import hashlib
from importlib.metadata import version
from pathlib import Path

from calibration.estimating.study import CalibrationStudy
from calibration.observed.reading import read_observed
from kinetics.network import Network, Tank
from kinetics.runs import RESTART
from kinetics.support.limits import bytes_in
from kinetics.support.tables import in_unit


def observed_study(
    source: str,
    network: Network,
    events: str | Path,
    runs: str | Path | None = None,
    *,
    cubes: int | None = None,
    single: str | None = None,
    tank: Tank | None = None,
    breaks: str | None = None,
) -> CalibrationStudy:
    """Read the tables of runs that others observed; the arguments are those of `read_observed`.

    source : name of the rule book or network file that gives the network
    breaks : name of a break model, `auto`, or None for breaks as they were counted

    ValueError: a table is wrong, or a channel follows a rate law, which has no rate constant to be estimated.
    """
    if not network.is_mass_action:
        named = ", ".join([*network.laws, *(event.name for event in network.events)])
        raise ValueError(f"{source}: rate constants are those of mass action; rate laws or events of its own: {named}")
    paths = list(read_observed(network, events, runs, cubes=cubes, single=single, tank=tank).values())
    files = [Path(file) for file in (events, runs) if file is not None]
    watched = in_unit(f"{sum(path.end for path in paths):g}", paths[0].network.time_unit)
    fired = sum(int((path.channels != RESTART).sum()) for path in paths)
    return CalibrationStudy(
        name=source,
        paths=paths,
        evidence={
            "network": source,
            "events_file": files[0].name,
            "tables_sha256": [hashlib.sha256(bytes_in(file)).hexdigest() for file in files],
            **({} if cubes is None else {"cubes": cubes}),
            "runs": len(paths),
            "versions": {name: version(name) for name in ("wellmixed", "numpy")},
        },
        source=f"{len(paths)} observed run{'s' if len(paths) > 1 else ''}, {watched} and {fired} events in all",
        made="Others observed the runs; their tables are the data.",
        breaks=breaks,
    )
