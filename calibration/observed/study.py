"""Calibration from what others observed: the same estimates, diagnostics and rates file as from mechanics runs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from calibration.estimating.break_comparison import BreakComparison, rates_with_breaks
from calibration.estimating.diagnosing.diagnosis import Diagnosis, diagnose
from calibration.estimating.estimate import Calibration, estimate
from calibration.observed.reading import read_observed
from kinetics.network import Network, Tank
from kinetics.rates import Rates
from kinetics.runs import JumpPath
from kinetics.support.limits import bytes_in
from kinetics.support.tables import in_unit


@dataclass(frozen=True, eq=False)
class ObservedStudy:
    """Runs that others observed, and what they show.

    name : of the rule book or network file
    runs : name of a run -> what happened
    settings : what else was said of the runs, for the evidence
    breaks : name of a break model, or `auto` for the one that the runs choose; None: breaks as they were counted
    """

    name: str
    runs: Mapping[str, JumpPath]
    settings: dict[str, Any]
    breaks: str | None = None

    @property
    def paths(self) -> list[JumpPath]:
        """All runs."""
        return list(self.runs.values())

    @property
    def problems(self) -> list[str]:
        """Runs that were left out: none, since a faulty table is refused."""
        return []

    @cached_property
    def calibration(self) -> Calibration:
        """Pooled events and exposures of all channels."""
        return estimate(self.paths)

    @cached_property
    def break_models(self) -> BreakComparison | None:
        """Break models fitted to the runs; None if none was asked for, or nothing breaks."""
        return None if self.breaks is None else BreakComparison.asked_for(self.breaks, self.paths)

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Are the runs those of a well-mixed Markov chain, whose bonds break as the chosen model says?"""
        return diagnose(self.paths, None if self.break_models is None else self.break_models.chosen)

    @property
    def source(self) -> str:
        """A sentence on the source of the rates."""
        runs, unit = len(self.paths), self.calibration.network.time_unit
        duration = in_unit(f"{sum(path.end for path in self.paths):g}", unit)
        events = int(self.calibration.total.events.sum())
        return f"{runs} observed run{'s' if runs > 1 else ''}, {duration} and {events} events in all"

    @property
    def made(self) -> str:
        """A sentence on how the runs were made."""
        return "Others observed the runs; their tables are the data."

    @cached_property
    def rates(self) -> Rates:
        """The estimates with their evidence, ready to be saved."""
        evidence = {
            "network": self.name,
            **self.settings,
            "runs": len(self.paths),
            "versions": {name: version(name) for name in ("wellmixed", "numpy")},
            "doubtful_tests": self.diagnosis.doubtful,
            **({"coarse_looks": self.diagnosis.looks.sentence} if self.diagnosis.looks.channels else {}),
        }
        return rates_with_breaks(self.calibration, self.break_models, evidence)


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
) -> ObservedStudy:
    """Read the tables of runs that others observed; the arguments are those of `read_observed`.

    source : name of the rule book or network file that gives the network
    breaks : name of a break model, `auto`, or None for breaks as they were counted

    ValueError: a table is wrong, or a channel follows a rate law, which has no rate constant to be estimated.
    """
    if not network.is_mass_action:
        named = ", ".join([*network.laws, *(event.name for event in network.events)])
        raise ValueError(f"{source}: rate constants are those of mass action; rate laws or events of its own: {named}")
    paths = read_observed(network, events, runs, cubes=cubes, single=single, tank=tank)
    files = [Path(file) for file in (events, runs) if file is not None]
    settings: dict[str, Any] = {
        "events_file": files[0].name,
        "tables_sha256": [hashlib.sha256(bytes_in(file)).hexdigest() for file in files],
    }
    return ObservedStudy(source, paths, settings | ({} if cubes is None else {"cubes": cubes}), breaks)
