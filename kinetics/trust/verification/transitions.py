"""Between times: counts minus their exact conditional mean given the state before."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from kinetics.support.arrays import Floats, Ints
from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.conditional import Expectations
from kinetics.trust.verification.each_time import EXPECTED, whole
from kinetics.trust.verification.reference import Reference
from kinetics.trust.verification.sampler_runs import SamplerRuns
from kinetics.trust.verification.tail_bounds import bennett, binomial, from_evidence, rare_events

ALL_PAIRS = 12  # species, up to which all pairs of them are judged
MOST_STEPS = 200  # pairs of states that are checked on their own
VISITS = 50  # runs in a state from which transitions are judged all together; fewer say little
RARE = 1e-12  # transitions at most as likely as that are looked at together


class BetweenTimes(SamplerCheck):
    """Products of a function now and what a later count departs from its conditional mean: their mean is 0.

    Bennett's bound from the exact variance, for spaces of any size. If the transition probabilities are computed,
    also each likely transition by its binomial probability, and all of them together by an e-value, given the states
    before, from each fine time to the next as well.
    """

    name = "transitions"
    sees = "counts that do not follow from those at the time before, as if taken from another run"

    def findings(self, sample: SamplerRuns) -> Iterator[SamplerFinding]:
        """Yield findings of every pair of neighbouring times."""
        times = sample.reference.solution.times
        for t, (begin, end) in enumerate(pairwise(times)):
            yield from _centred(sample, t, f"from {begin:g} to {end:g} tu")
            matrix = sample.reference.matrices[t]
            if matrix is not None:
                yield from _by_states(sample, t, matrix, f"from {begin:g} to {end:g} tu")
        # Nowhere is the start seen better than at the first fine time, when little has happened.
        fine_times = np.append(0.0, sample.reference.fine_times)
        rows = np.hstack([np.zeros((len(sample.fine), 1), dtype=np.intp), sample.fine_rows])
        for t, matrix in enumerate(sample.reference.fine_matrices):
            if matrix is not None:
                between = f"from {fine_times[t]:g} to {fine_times[t + 1]:g} tu, by fine times"
                yield from _together(*_table(rows[:, t], rows[:, t + 1], len(matrix.values)), matrix, between)


def _centred(sample: SamplerRuns, t: int, between: str) -> Iterator[SamplerFinding]:
    reference = sample.reference
    names, p = reference.network.species, reference.solution.probabilities[t]
    shares = reference.shares[t + 1]
    expected = reference.conditional_moments[t]
    if expected is None:
        return
    n_species = len(names)
    means, squares = expected.values[:, :n_species], expected.values[:, n_species:-1]
    lost = float(p @ np.maximum(1.0 - expected.values[:, -1], 0.0)) if not reference.solution.is_complete else 0.0
    error = lost + 2.0 * expected.error + 2.0 * reference.error
    before, after = sample.rows[:, t], sample.rows[:, t + 1]
    known = before >= 0
    off = np.where((after >= 0)[:, None], shares[after], 0.0) - means[before]
    for what, weights in _weights(reference, t):
        width = float(np.abs(weights).max())
        seen = np.where(known, weights[before], 0.0)
        for s, name in enumerate(names):
            if n_species > ALL_PAIRS and what not in ("", name):
                continue
            found = float((seen * off[:, s]).mean())
            variance = float((p * weights**2) @ np.maximum(squares[:, s] - means[:, s] ** 2, 0.0))
            label = f"{name}{f' by {what}' if what else ''} {between}, less its conditional mean"
            yield SamplerFinding(label, found, 0.0, bennett(found, variance, width, sample.runs, error * width))


def _weights(reference: Reference, t: int) -> Iterator[tuple[str, Floats]]:
    """Functions (N,) of the state before: 1, and of each species its count about the mean and whether it is large."""
    yield "", np.ones(len(reference.states))
    shares, median = reference.shares[t], reference.solution.quantile(0.5)[t]
    mean = reference.solution.probabilities[t] @ shares
    for s, name in enumerate(reference.network.species):
        yield name, shares[:, s] - mean[s]
        yield f"{name} >= {median[s]:g}", (reference.states[:, s] >= median[s]).astype(float)


def _by_states(sample: SamplerRuns, t: int, matrix: Expectations, between: str) -> Iterator[SamplerFinding]:
    reference = sample.reference
    chances, error = np.maximum(matrix.values, 0.0), matrix.error
    visits, hits = _table(sample.rows[:, t], sample.rows[:, t + 1], len(chances))

    # Which are judged on their own must not depend on the runs.
    joint = sample.runs * reference.solution.probabilities[t][:, None] * chances
    order = np.argsort(joint, axis=None)[::-1][:MOST_STEPS]
    rows, columns = np.unravel_index(order[joint.ravel()[order] >= EXPECTED], joint.shape)
    p_values = binomial(hits[rows, columns], visits[rows], chances[rows, columns], error)
    names = reference.solution.space.states
    for i, j, p_value in zip(rows, columns, p_values, strict=True):
        what = f"state {names[i].tolist()} to {names[j].tolist()} {between}"
        yield SamplerFinding(what, hits[i, j] / max(visits[i], 1), float(chances[i, j]), float(p_value))

    yield from _together(visits, hits, matrix, between)


def _table(before: Ints, after: Ints, n_states: int) -> tuple[Ints, Ints]:
    """Numbers of runs in each state before (N,), and in each state before and after (N, N)."""
    known = (before >= 0) & (after >= 0)
    hits = np.bincount(before[known] * n_states + after[known], minlength=n_states**2)
    return np.bincount(before[before >= 0], minlength=n_states), hits.reshape(n_states, n_states)


def _together(visits: Ints, hits: Ints, matrix: Expectations, between: str) -> Iterator[SamplerFinding]:
    chances, error = np.maximum(matrix.values, 0.0), matrix.error
    rare = chances <= RARE
    seen, expected = int(hits[rare].sum()), float(visits @ ((chances * rare).sum(axis=1) + error))
    yield SamplerFinding(
        f"transitions that are nearly impossible {between}", seen, expected, rare_events(seen, expected)
    )

    # E-values of the states before multiply: given those, what comes after is independent.
    log_value = 0.0
    for row in np.flatnonzero(visits >= VISITS):
        n = int(visits[row])
        log_value += whole(hits[row], chances[row], np.flatnonzero(n * chances[row] >= EXPECTED), n, error)
    yield SamplerFinding(f"all transitions together {between}", 0.0, 0.0, from_evidence(log_value))
