"""The score of each rate: the relative change, by that rate, of the probability of what a run did.

Its mean over right runs is 0, and no other function of a run shows a small error of the rate in fewer runs. It is found
by solving with the rate constant a little higher, and cut off so that it has a largest size. Mean and variance of what
is left are computed from the unchanged solution alone, so that a right sampler is judged by exact figures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kinetics.markov.transient import Distribution
from kinetics.markov.transient.states import StateSpace
from kinetics.support.arrays import Floats
from kinetics.trust.verification.conditional import Expectations, chain_of, transition_matrix

STEP = 0.01  # by which a rate is raised
TOGETHER = 150  # states, up to which all times are judged together
CUT = 8.0  # standard deviations
SMALLEST = 1e-9  # probabilities below have a score of 0


@dataclass(frozen=True, eq=False)
class RateScore:
    """The score of a channel's rate as tables of states, centred; to be added up over the times of a run.

    tables : by number of the time; (N,) of the state, or (N, N) of the state before and the state
    variance, width : of the sum, exact, and its largest size
    error : of its mean, which is 0
    slope : its mean where the rate is higher, by relative change of the rate
    """

    channel: str
    when: str
    tables: tuple[tuple[int, Floats], ...]
    variance: float
    width: float
    error: float
    slope: float


def rate_scores(
    solution: Distribution, changed: Sequence[Distribution], matrices: Sequence[Expectations | None], gaps: Floats
) -> Iterator[RateScore]:
    """Scores of all channels: of all times together for up to TOGETHER states, else of each time by itself.

    changed : the solution with each rate constant higher by STEP
    matrices : transition probabilities from each time to the next, if they are computed; gaps : tu, of all times
    """
    for channel, other in zip(solution.network.channels, changed, strict=False):
        rows = other.space.index_of(solution.space.states)  # they may come in another order
        higher = np.where(rows >= 0, other.probabilities[:, rows], 0.0)
        first = [_of_states(channel, t, solution, higher[t]) for t in range(solution.times.size)]
        together = len(solution.space) <= TOGETHER and all(matrix is not None for matrix in matrices)
        score = _together(first[0], solution, other, higher, matrices, gaps) if together else None
        yield from first if score is None else [score]


def _of_states(channel: str, t: int, solution: Distribution, higher: Floats) -> RateScore:
    p = solution.probabilities[t]
    score = _ratio(p, higher)
    cut = CUT * float(np.sqrt(p @ score**2))
    score = np.clip(score, -cut, cut)
    score -= float(p @ score)
    return RateScore(
        channel,
        f"at {solution.times[t]:g} tu",
        ((t, score),),
        float(p @ score**2),
        2.0 * cut,
        4.0 * (solution.error + 1e-14) * cut,
        float(higher @ score) / STEP,
    )


def _together(
    first: RateScore,
    solution: Distribution,
    other: Distribution,
    higher: Floats,
    matrices: Sequence[Expectations | None],
    gaps: Floats,
) -> RateScore | None:
    space = solution.space
    chain = chain_of(StateSpace(other.network, space.states, space.is_stopped))
    tables = [*first.tables]
    variance, width, error, slope = first.variance, first.width, first.error, first.slope
    for t, matrix in enumerate(matrices):
        after = transition_matrix(chain, float(gaps[t + 1]))
        if matrix is None or after is None:
            return None
        p, chances = solution.probabilities[t], np.maximum(matrix.values, 0.0)
        score = _ratio(chances, after.values)
        cut = CUT * float(np.sqrt(p @ (chances * score**2).sum(axis=1)))
        score = np.clip(score, -cut, cut)
        score -= (chances * score).sum(axis=1)[:, None]
        tables.append((t + 1, score))
        variance += float(p @ (chances * score**2).sum(axis=1))
        slope += float(higher[t] @ (after.values * score).sum(axis=1)) / STEP
        width += 2.0 * cut
        error += 4.0 * (solution.error + matrix.error + 1e-12) * cut
    return RateScore(first.channel, "at all times", tuple(tables), variance, width, error, slope)


def _ratio(p: Floats, higher: Floats) -> Floats:
    held = p > SMALLEST
    return np.where(held, (higher - p) / (STEP * np.where(held, p, 1.0)), 0.0)
