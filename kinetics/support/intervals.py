"""Intervals of rates and of means, and random draws of rates, defined once for all modules."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats
from kinetics.support.packages import special


def exact_limits(
    events: ArrayLike, exposure: ArrayLike, level: float = 0.95, fixed: str = "exposure"
) -> tuple[Floats, Floats]:
    """Lower and upper limits of the rates behind counts `events`, in units of 1 / exposure.

    fixed : what was chosen beforehand: `exposure` for runs of a given length (Garwood 1936,
        doi:10.1093/biomet/28.3-4.437; finite also for no events), or `events` for observation until that many events
        had happened (chi-square with 2 n degrees of freedom)

    The limits are exact where the exposure itself is fixed. They are approximate where it follows from the path, with a
    coverage near the level once there are about ten events. They are (0, inf) if there is no exposure.

    >>> from kinetics.support.intervals import exact_limits
    >>> low, high = exact_limits([0, 4], 200.0)
    >>> low.round(4).tolist(), high.round(4).tolist()
    ([0.0, 0.0054], [0.0184, 0.0512])
    """
    if not 0 < level < 1:
        raise ValueError(f"level = {level}; expected a number between 0 and 1, such as 0.95")
    if fixed not in {"exposure", "events"}:
        raise ValueError(f"fixed = {fixed!r}; expected 'exposure' or 'events'")
    n, total = np.broadcast_arrays(np.asarray(events, dtype=float), np.asarray(exposure, dtype=float))
    if fixed == "events" and (n == 0).any():
        raise ValueError("fixed = 'events' needs at least one event in every channel; use 'exposure'")
    tail = (1 - level) / 2
    low = np.where(n > 0, special.gammaincinv(np.where(n > 0, n, 1), tail), 0.0)
    high = special.gammainccinv(n + 1 if fixed == "exposure" else n, tail)
    is_measured = total > 0
    return (
        np.divide(low, total, out=np.zeros(n.shape), where=is_measured),
        np.divide(high, total, out=np.full(n.shape, np.inf), where=is_measured),
    )


def binomial_limits(hits: ArrayLike, runs: int, level: float = 0.95) -> tuple[Floats, Floats]:
    """Exact (conservative) interval ends (...) of probabilities, from `hits` (...) among `runs`.

    Clopper & Pearson (1934), doi:10.1093/biomet/26.4.404.
    """
    if not 0 < level < 1:
        raise ValueError(f"level = {level}; expected a number between 0 and 1, such as 0.95")
    found, tail = np.asarray(hits), (1 - level) / 2
    low, high = np.zeros(found.shape), np.ones(found.shape)
    some, rest = found > 0, found < runs
    low[some] = special.betaincinv(found[some], runs - found[some] + 1, tail)
    high[rest] = special.betaincinv(found[rest] + 1, runs - found[rest], 1 - tail)
    return low, high


def jeffreys_posterior(events: float, exposure: float) -> tuple[float, float]:
    """Shape and rate of the Gamma posterior of a rate under Jeffreys' (1946) prior: events + 1/2, exposure."""
    return events + 0.5, exposure


def posterior_draws(
    rng: np.random.Generator,
    n: int,
    rates: Sequence[float],
    events: Sequence[float | None],
    exposure: Sequence[float | None],
) -> Floats:
    """(n, R) draws of R rates from their posteriors under Jeffreys' prior; the rate itself if there is no evidence.

    The draws of one rate come together, in the order of the rates.
    """
    draws = np.empty((n, len(rates)))
    for column, rate, seen, watched in zip(draws.T, rates, events, exposure, strict=True):
        if seen is None or watched is None:
            column[:] = rate
        else:
            shape, total = jeffreys_posterior(seen, watched)
            column[:] = rng.gamma(shape, 1.0 / total, size=n)
    return draws


def student_quantile(freedom: float, level: float = 0.95) -> float:
    """Half-width, in standard errors, of an interval at `level` by Student's t with so many degrees of freedom."""
    return float(special.stdtrit(freedom, (1 + level) / 2))


def student_interval(values: ArrayLike, level: float = 0.95) -> tuple[Any, Any]:
    """Interval of the mean over the first axis by Student's t; nan for a single run."""
    table = np.asarray(values)
    runs = len(table)
    if runs == 1:
        unknown = np.full(table.shape[1:], np.nan)
        return unknown, unknown
    mean = np.mean(table, axis=0)
    half = student_quantile(runs - 1, level) * np.std(table, axis=0, ddof=1) / np.sqrt(runs)
    return mean - half, mean + half
