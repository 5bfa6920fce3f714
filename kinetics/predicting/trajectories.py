"""Trajectories: single sampled runs next to a prediction, with every event."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kinetics.network import Network
from kinetics.predicting.job import Job
from kinetics.runs import JumpPath, TruncatedRunsError
from kinetics.sampling.methods import path_method
from kinetics.support import plots
from kinetics.support.arrays import Floats, Ints, whole_number
from kinetics.support.datasets import dataframe, dataframe_over_times
from kinetics.support.packages import pd
from kinetics.support.shown import Tabular, on_axes
from kinetics.support.tables import in_unit

MOST_TRAJECTORIES = 100
MOST_EVENTS = 100_000  # of all trajectories together: more than a figure can show
MOST_COUNTS = 2**24  # of one trajectory: events times species, 128 MB


@dataclass(frozen=True, eq=False)
class Trajectories(Tabular):
    """Single exact runs, numbered 0 to N - 1.

    network : names what is shown, V species or sums of their counts
    paths : the N jump paths of the model itself; one that was cut has an earlier `end`
    weights : (S, V) of the sums that are shown; None for all species
    method : by which they were sampled
    most : events at which a run is cut
    cut : numbers of the runs that were cut, before an event too many
    """

    network: Network
    paths: tuple[JumpPath, ...]
    weights: Ints | None
    method: str
    most: int
    cut: tuple[int, ...] = ()

    def steps(self, run: int) -> tuple[Floats, Ints]:
        """Times (E + 1,), 0 and those of the E events, and the counts (E + 1, V) from each of them on."""
        path = self.paths[run]
        counts = path.states if self.weights is None else path.states @ self.weights
        return np.append(0.0, path.times), counts

    @property
    def notes(self) -> tuple[str, ...]:
        """How many there are, by which method, and which were cut."""
        n, unit = len(self.paths), self.network.time_unit
        what = "1 trajectory" if n == 1 else f"{n} trajectories"
        events = sum(path.times.size for path in self.paths)
        said = [f"{what} sampled by {self.method}, {events} events in all"]
        if self.cut:
            first = self.cut[0]
            at = in_unit(f"{self.paths[first].end:.4g}", unit)
            said.append(
                f"{len(self.cut)} of {n} trajectories cut before event {self.most}, or where events came too fast: "
                f"trajectory {first} at {at}; ask for fewer, or for an earlier time"
            )
        return tuple(said)

    def to_dict(self) -> dict[str, Any]:
        """For JSON: times and counts of each run, and until when it holds."""
        runs = []
        for run, path in enumerate(self.paths):
            times, counts = self.steps(run)
            runs.append({"run": run, "times": times, "counts": counts, "end": path.end, "cut": run in self.cut})
        return {"method": self.method, "max_events": self.most, "runs": runs}

    def to_dataframe(self) -> pd.DataFrame:
        """One row per run, moment and species: run, time, event ("start", a channel, "end"), species, copies."""
        names, tables = self.network.species, []
        for run, path in enumerate(self.paths):
            moments, counts = self.moments(run)
            rows = dataframe_over_times(moments, "species", names, {"copies": counts})
            events = ["start", *(path.network.channels[channel] for channel in path.channels), "end"]
            rows.insert(0, "run", run)
            rows.insert(2, "event", np.repeat(np.array(events, dtype=object), len(names)))
            tables.append(rows)
        return dataframe(pd.concat(tables, ignore_index=True))

    @on_axes
    def plot(self, ax: Any, only: int | None = None) -> Any:
        """Thin steps behind the means on the axes, one colour a species; returns `ax`.

        only : draw the species of this number alone
        """
        return plots.thin_steps(ax, [self.moments(run) for run in range(len(self.paths))], only)

    def moments(self, run: int) -> tuple[Floats, Ints]:
        """Times and counts of `steps`, and once more the last counts at the end of the run."""
        times, counts = self.steps(run)
        return np.append(times, self.paths[run].end), np.vstack([counts, counts[-1:]])


def sample_trajectories(job: Job, runs: int) -> Trajectories:
    """Sample `runs` single runs of a job's model from time 0 until its last time: runs 0, 1, ... of `sample_path`.

    Each is the same for any number of them, any times and any method of the prediction. All together hold at most
    `MOST_EVENTS` events; a run that would make more than its share, or than the job's `max_events`, is cut before.
    ValueError: more than `MOST_TRAJECTORIES`, or a network with events that set counts, which no jump path records

    Cost: that of the events, and memory for each of them.

    >>> from kinetics import Model, Network
    >>> from kinetics.predicting import Job
    >>> from kinetics.predicting.trajectories import sample_trajectories
    >>> job = Job(Model(Network.from_text("A -> 0, 1"), {"A": 3}), [50.0], seed=1)
    >>> times, counts = sample_trajectories(job, 2).steps(0)
    >>> times.size, counts[:, 0].tolist()
    (4, [3, 2, 1, 0])
    """
    network, start, end = job.model.network, job.model.initial, float(job.grid[-1])
    if whole_number("trajectories", runs, 1) > MOST_TRAJECTORIES:
        raise ValueError(f"{runs} trajectories; expected at most {MOST_TRAJECTORIES}: more cannot be told apart")
    if network.events:
        raise ValueError(
            f"trajectories record firings of channels only, but event {network.events[0].name!r} sets counts; leave "
            f"them out"
        )
    method = path_method(network)
    most = min(job.max_events, MOST_EVENTS // runs, max(1, MOST_COUNTS // len(network.species)))
    paths, cut = [], []
    for run in range(runs):
        job.report(f"trajectory {run + 1} of {runs}")
        try:
            path = method.sample_path(network, start, end, job.seed, run, most)
        except TruncatedRunsError as error:  # the run is the same until any end: take it until just before
            before = float(np.nextafter(error.truncation.time, 0.0))
            path = method.sample_path(network, start, before, job.seed, run, most)
            cut.append(run)
        paths.append(path)
    sums = job.observables
    return Trajectories(job.shown, tuple(paths), None if sums is None else sums.weights, method.name, most, tuple(cut))
