"""The distribution at each time by itself: states, distribution functions, moments, and all states together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from kinetics.support.arrays import Floats, Ints
from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.sampler_runs import SamplerRuns
from kinetics.trust.verification.tail_bounds import bennett, binomial, from_evidence, log_evidence, rare_events

EXPECTED = 5.0  # runs in a state that is checked on its own
LEVELS = 64  # counts of a species at which its distribution function is checked


class EachTime(SamplerCheck):
    """States and distribution functions by exact binomial probabilities, moments by Bennett's bound."""

    name = "each time"
    sees = "a wrong distribution at one of the times, as a whole or in its moments"

    def findings(self, sample: SamplerRuns) -> Iterator[SamplerFinding]:
        """Yield findings of every time: likely states, the rest, species, products of two, the whole distribution."""
        for t, time in enumerate(sample.reference.solution.times):
            yield from _states(sample, t, f"at {time:g} tu")
            yield from _species(sample, t, f"at {time:g} tu")


def _states(sample: SamplerRuns, t: int, at: str) -> Iterator[SamplerFinding]:
    solution, n, rows = sample.reference.solution, sample.runs, sample.rows[:, t]
    p, error, states = solution.probabilities[t], sample.reference.error, solution.space.states
    hits = np.bincount(rows[rows >= 0], minlength=len(states))
    likely = np.flatnonzero(n * p >= EXPECTED)
    for i, p_value in zip(likely, binomial(hits[likely], n, p[likely], error), strict=True):
        yield SamplerFinding(f"state {states[i].tolist()} {at}", hits[i] / n, float(p[i]), float(p_value))
    others, rest = n - int(hits[likely].sum()), max(1.0 - float(p[likely].sum()), 0.0)
    yield SamplerFinding(
        f"all other states {at}", others / n, rest, float(binomial(np.array([others]), n, np.array([rest]), error)[0])
    )
    # What no chain can do is not left to chance.
    strays = int((rows < 0).sum())
    possible = 0.0 if solution.is_complete else n * error
    yield SamplerFinding(f"states that are impossible {at}", strays / n, 0.0, rare_events(strays, possible))
    yield SamplerFinding(f"all states together {at}", 0.0, 0.0, from_evidence(whole(hits, p, likely, n, error)))


def whole(hits: Ints, p: Floats, likely: Ints, n: int, error: float) -> float:
    """Log of the e-value of all cells; the unlikely ones are one cell, or join the least likely of the others."""
    if likely.size < 2:
        return 0.0
    cells, chances = hits[likely].astype(float), p[likely].copy()
    others, rest = n - cells.sum(), max(1.0 - float(chances.sum()), 0.0)
    if n * rest >= EXPECTED:
        cells, chances = np.append(cells, others), np.append(chances, rest)
    else:
        least = int(chances.argmin())
        cells[least] += others
        chances[least] += rest
    return log_evidence(cells, chances, error)


def _species(sample: SamplerRuns, t: int, at: str) -> Iterator[SamplerFinding]:
    reference = sample.reference
    names, p, states = reference.network.species, reference.solution.probabilities[t], reference.solution.space.states
    # Runs may go where a projection has no states; such counts are cut off, on both sides of the comparison.
    counts = np.minimum(sample.counts[:, t], reference.tops.astype(np.int64))
    for s, name in enumerate(names):
        yield from _distribution_function(f"{name} {at}", counts[:, s], states[:, s], p, reference.error)
        yield _moment(f"mean of {name} {at}", counts[:, s], states[:, s], p, reference.tops[s], reference.error)
        for other in range(s, len(names)):
            products = counts[:, s] * counts[:, other].astype(float)
            exact = states[:, s] * states[:, other].astype(float)
            top = reference.tops[s] * reference.tops[other]
            yield _moment(f"mean of {name} * {names[other]} {at}", products, exact, p, top, reference.error)


def _distribution_function(what: str, counts: Ints, copies: Ints, p: Floats, error: float) -> Iterator[SamplerFinding]:
    below: Floats = np.cumsum(np.bincount(copies, p))
    hits = np.cumsum(np.bincount(counts, minlength=below.size))
    inside = np.flatnonzero((below > 0) & (below < 1 - 1e-12))
    levels = inside[:: max(1, -(-inside.size // LEVELS))]
    for level, p_value in zip(levels, binomial(hits[levels], counts.size, below[levels], error + 1e-14), strict=True):
        yield SamplerFinding(
            f"at most {level} of {what}", float(hits[level] / counts.size), float(below[level]), float(p_value)
        )


def _moment(what: str, values: Any, exact_values: Any, p: Floats, top: float, error: float) -> SamplerFinding:
    mean = float(p @ exact_values)
    variance, found = float(p @ (exact_values - mean) ** 2), float(values.mean())
    return SamplerFinding(what, found, mean, bennett(found - mean, variance, top, values.size, error * top))
