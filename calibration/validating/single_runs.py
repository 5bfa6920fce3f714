"""Single held-out runs judged by the randomised probability integral transform (PIT).

The PIT of a run's value x is F(x-) + v (F(x) - F(x-)), F being the predicted distribution of that value in a single
run and v uniform: uniform under the model also if values are whole numbers (Czado, Gneiting & Held 2009,
doi:10.1111/j.1541-0420.2009.01191.x). Runs share the draw of the rates and values of one run hang together, so the
Kolmogorov-Smirnov distance of all PITs is judged among those of simulated groups, not by its textbook distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration import plots
from calibration.validating.predictive import upper_p
from kinetics.support.arrays import Floats
from kinetics.support.shown import on_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class SingleRuns:
    """PITs of n held-out runs.

    names : of the Q values of a run
    pit : (n, Q) in [0, 1]
    distance, p_value : Kolmogorov-Smirnov distance of all of them from uniform, and the share of simulated groups of n
        runs with at least that distance
    simulated : (D,) the distances of the simulated groups
    band_low, band_high : 95 % of the simulated groups have between them as many PITs in a bin (BINS,) of the histogram
    """

    names: tuple[str, ...]
    pit: Floats
    distance: float
    p_value: float
    simulated: Floats
    band_low: Floats
    band_high: Floats

    def to_dict(self) -> dict[str, Any]:
        """All but the distances of the simulated groups."""
        return {name: value for name, value in vars(self).items() if name != "simulated"}

    @on_axes
    def plot(self, ax: Axes) -> Axes:
        """The histogram of all PITs beside its range under the model; returns `ax`."""
        return plots.pit_histogram(ax, self.pit, self.band_low, self.band_high, self.p_value)


BINS = 10


def judge_single_runs(names: tuple[str, ...], seen: Floats, simulated: Floats, seed: int) -> SingleRuns:
    """Judge values (n, Q) of the held-out runs among those of simulated groups (D, n, Q).

    F is the distribution in all groups, the held-out one included, so that it is one more group like the others.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(6,)))
    everything = np.concatenate([seen[None], simulated])
    groups, n, values = everything.shape
    pit = np.empty(everything.shape)
    for q in range(values):
        column = everything[:, :, q].ravel()
        ordered = np.sort(column)
        below = np.searchsorted(ordered, column, "left")
        ties = np.searchsorted(ordered, column, "right") - below
        pit[:, :, q] = ((below + rng.random(column.size) * ties) / column.size).reshape(groups, n)
    flat = np.sort(pit.reshape(groups, n * values), axis=1)
    step = np.arange(n * values + 1) / (n * values)
    distances = np.maximum((step[1:] - flat).max(axis=1), (flat - step[:-1]).max(axis=1))
    places = np.minimum((flat * BINS).astype(int), BINS - 1)
    tallies = np.stack([(places == b).sum(axis=1) for b in range(BINS)], axis=1)
    low, high = np.quantile(tallies[1:], [0.025, 0.975], axis=0, method="inverted_cdf")
    return SingleRuns(
        names,
        pit[0],
        float(distances[0]),
        upper_p(float(distances[0]), distances[1:]),
        distances[1:],
        low.astype(float),
        high.astype(float),
    )


def pooled_p(experiments: Sequence[SingleRuns]) -> float:
    """P-value of the single runs of several experiments of one study, by the rank of Fisher's statistic (1932).

    Their p-values are not independent, because all experiments share the true rates. So do simulated groups of one
    number, of which there must be equally many: among these the sum of -log p is ranked, not by its textbook
    distribution.
    """
    totals = np.sum([_surprise(each) for each in experiments], axis=0)
    return upper_p(float(totals[0]), totals[1:])


def _surprise(runs: SingleRuns) -> Floats:
    """-log p (1 + D,) of the held-out group, then of each simulated one among all of them."""
    distances = np.append(runs.distance, runs.simulated)
    below = np.searchsorted(np.sort(distances), distances, "left")
    return np.asarray(-np.log1p(-below / distances.size))
