"""Jump paths as a camera sees them: one table of counts at times 0, T, 2T, ... of each run.

    run, time, and a column for each species: its copies at that time     a row a look

The table does not record what happened between two looks. docs/your_data.md describes what a reader takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal

import numpy as np

from kinetics.runs.paths import RESTART, JumpPath
from kinetics.support.arrays import Floats
from kinetics.support.packages import pd

MOST_CELLS = 10_000_000  # of a table, as many as its reader takes


def count_table(runs: Mapping[str, JumpPath], every: float) -> pd.DataFrame:
    """Counts (looks, 2 + S) of each run at times 0, T, 2T, ... up to its end: run, time in tu, and all species.

    runs : name -> path; all of one network
    every : T, the time between two looks, tu

    A look at the time of an event counts what the event left. ValueError: T is not above 0, finite, and at most the
    length of the shortest run; a run was put back to its start; the runs are of two networks, or did not have the same
    channels open; or the table is too large.

    >>> from kinetics import JumpPath, Network
    >>> from kinetics.runs.count_tables import count_table
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> path = JumpPath(decay, {"A": 2}, times=[0.5, 1.5], channels=[0, 0], end=3.5)
    >>> count_table({"first": path}, every=1.0)["A"].tolist()
    [2, 1, 0, 0]
    """
    if not (np.isfinite(every) and every > 0):
        raise ValueError(f"every = {every:g}; expected a time between two looks in tu, finite and above 0")
    for name, path in runs.items():
        _check(name, path, every)
    if not runs:
        return pd.DataFrame({"run": pd.Series(dtype="str"), "time": pd.Series(dtype="float64")})
    first_name, first = next(iter(runs.items()))
    for name, path in runs.items():
        if path.network.species != first.network.species or path.network.channels != first.network.channels:
            raise ValueError(f"runs {first_name} and {name} are of two networks; a table holds runs of one")
        if (path.open_channels != first.open_channels).any():
            raise ValueError(
                f"runs {first_name} and {name} did not have the same channels open, which counts cannot say; make a "
                f"table of each kind of run, or take events"
            )
    looks = [int(path.end / every * (1.0 + 1e-12)) + 1 for path in runs.values()]
    titles = ["run", "time", *first.network.species]
    if sum(looks) * len(titles) > MOST_CELLS:
        raise ValueError(
            f"every = {every:g} tu makes {sum(looks)} rows of {len(titles)} cells; a table has at most {MOST_CELLS} "
            f"cells: take a longer time"
        )
    clock = _clock(every, max(looks))
    times = [np.minimum(clock[:n], path.end) for n, path in zip(looks, runs.values(), strict=True)]
    counts = np.concatenate([path.at(when) for path, when in zip(runs.values(), times, strict=True)])
    table = {"run": np.repeat(np.array(list(runs), dtype=object), looks), "time": np.concatenate(times)}
    return pd.DataFrame(table | dict(zip(first.network.species, counts.T, strict=True)))


def _check(name: str, path: JumpPath, every: float) -> None:
    """ValueError: looks at these times would mislead, or there are none."""
    if (path.channels == RESTART).any():
        # Neither one run nor several: each stretch ends with the event that a look at a fixed time comes too late for.
        raise ValueError(
            f"run {name} was put back to its start after each event: looks at fixed times miss these events, and rates "
            f"from such counts are too low; take its events, or runs without restarts"
        )
    if every > path.end:
        raise ValueError(
            f"every = {every:g} tu is longer than run {name}, which ended at {path.end:g} tu; take a shorter time"
        )
    if every < path.resolution:
        raise ValueError(
            f"every = {every:g} tu is shorter than {path.resolution:g} tu, the time within which events of run {name} "
            f"are not told apart; take a longer time"
        )


def _clock(every: float, looks: int) -> Floats:
    """Times (looks,) of the looks: the float nearest to each decimal multiple, so that a table shows 0.3 as 0.3."""
    exact = Decimal(repr(float(every)))
    return np.array([float(k * exact) for k in range(looks)])
