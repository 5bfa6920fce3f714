"""Whether each rate constant is right, by the mean of its score; and how many runs show that it is not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.reference import Reference
from kinetics.trust.verification.sampler_runs import SamplerRuns
from kinetics.trust.verification.tail_bounds import bennett, chance

MISSED = 1e-3  # chance to miss what is called seen
MOST_RUNS = 60.0  # as a power of 2


class RateScores(SamplerCheck):
    """The mean of each rate's score, which is 0, by Bennett's bound from its exact variance."""

    name = "rates"
    sees = "a rate constant, multiplicity or number of combinations that is slightly off"

    def findings(self, sample: SamplerRuns) -> Iterator[SamplerFinding]:
        """Yield the findings of every channel; none of networks with rate laws or too many channels."""
        for score in sample.reference.scores:
            values = np.zeros(sample.runs)
            for t, table in score.tables:
                rows, before = sample.rows[:, t], sample.rows[:, max(t - 1, 0)]
                known = (rows >= 0) & (before >= 0)
                values[known] += table[rows[known]] if table.ndim == 1 else table[before[known], rows[known]]
            found = float(values.mean())
            p_value = bennett(found, score.variance, score.width, sample.runs, score.error)
            yield SamplerFinding(f"score of the rate of {score.channel} {score.when}", found, 0.0, p_value)


@dataclass(frozen=True)
class RateSight:
    """Detectable error of one channel's rate constant: missed one time in a thousand.

    smallest : relative error that the runs made show; runs_for_one_percent : runs that show an error of 1 %
    """

    channel: str
    smallest: float
    runs_for_one_percent: float


def sight_of_rates(reference: Reference, runs: int, level: float) -> tuple[RateSight, ...]:
    """The smallest error of each channel's rate that `runs` runs detect, if findings fail at p-values of `level`.

    For small errors: the mean of the score grows in proportion to them, and its variance stays.
    """
    best: dict[str, RateSight] = {}
    for score in reference.scores:

        def needed(n: float, variance: float = score.variance, width: float = score.width) -> float:
            return chance(variance, width, n, level) + chance(variance, width, n, MISSED)

        slope = abs(score.slope)
        low, high = 0.0, MOST_RUNS
        while high - low > 0.01:
            middle = (low + high) / 2
            low, high = (low, middle) if needed(2.0**middle) <= 0.01 * slope else (middle, high)
        smallest = needed(runs) / slope if slope > 0.0 else np.inf
        sight = RateSight(score.channel, smallest, 2.0**high if high < MOST_RUNS else np.inf)
        if score.channel not in best or smallest < best[score.channel].smallest:
            best[score.channel] = sight
    return tuple(best.values())
