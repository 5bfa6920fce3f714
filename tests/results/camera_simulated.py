"""Does what frames leave out bias the rates? Runs simulated at known rates, thinned and fitted: many times over.

    python -m tests.results.camera_simulated

makes the data sets that results/camera/simulated.csv lacks, in some fifteen minutes of CPU time, on two processes.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd

from calibration.estimating.exposure import count, pooled
from calibration.estimating.likelihood_fit import ParameterFit, fit_parameters
from kinetics.commands.models import network_of_book
from kinetics.network import Network
from kinetics.runs import JumpPath
from kinetics.sampling import sample_path
from kinetics.support.arrays import Floats
from kinetics.support.output import write_whole
from tests.results.frame_likelihood import FrameLikelihood, frames_of

FILE = Path(__file__).parents[2] / "results" / "camera" / "simulated.csv"
EVERY = (1, 10, 50, 200)  # tu
SETS, RUNS, LENGTH = 200, 100, 1000.0
STARTS = ([12, 0, 0, 0], [0, 0, 0, 3])  # counts of monomers to quadmers, in turn
# 1/tu, of the channels in the network's order: breaks are so frequent that all channels fire often, and many events
# between two frames undo each other
TRUE = np.array([3.0, 2.5, 2.25, 1.75, 8.0, 10.0, 18.0, 10.0]) * 1e-4


def network() -> Network:
    """The line of four at the true rates."""
    return network_of_book("line4")[0].with_rates(TRUE)


def paths(number: int) -> list[JumpPath]:
    """The runs of one data set; its number is the seed."""
    return [sample_path(network(), STARTS[run % 2], LENGTH, seed=number, run=run) for run in range(RUNS)]


def fit_events(runs: list[JumpPath]) -> ParameterFit:
    """Rate constants by events, channel by channel: their number over the exposure, with profile intervals."""
    seen = pooled(count(path) for path in runs)
    numbers, exposure = seen.events, seen.exposure

    def scored(logs: Floats) -> tuple[float, Floats]:
        expected = np.exp(logs) * exposure
        return float(numbers @ logs - expected.sum()), numbers - expected

    return fit_parameters(scored, runs[0].network.channels, numbers / exposure, starts=1)


def rows_of(number: int) -> list[tuple[object, ...]]:
    """Estimates of one data set, by events (every = 0) and by frames: set, every, channel, rate, low, high."""
    runs = paths(number)
    names = network().channels
    found = {0: fit_events(runs)}
    for every in EVERY:
        asked = FrameLikelihood(network(), every, frames_of(runs, every)[0])
        found[every] = fit_parameters(asked.scored, names, TRUE, starts=1)
    return [
        (number, every, name, fit.value[p], fit.low[p], fit.high[p])
        for every, fit in found.items()
        for p, name in enumerate(names)
    ]


def main() -> None:
    """Add the data sets that are missing, 1 to 200."""
    titles = ["set", "every", "channel", "rate", "low", "high"]
    known = pd.read_csv(FILE) if FILE.exists() else pd.DataFrame(columns=titles)
    missing = sorted(set(range(1, SETS + 1)) - set(known["set"]))
    FILE.parent.mkdir(exist_ok=True)
    with ProcessPoolExecutor(2) as workers:
        for rows in workers.map(rows_of, missing):
            new = pd.DataFrame(rows, columns=titles)
            known = new if known.empty else pd.concat([known, new], ignore_index=True)
            write_whole(FILE, known.to_csv(index=False, float_format="%.8g"))


if __name__ == "__main__":
    main()
