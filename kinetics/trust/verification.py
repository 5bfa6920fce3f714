"""Verification of a sampler: its runs against the certified solution of the master equation.

Every check compares the mean of a bounded function over the runs with its exact mean, and allows for chance by
Bernstein's inequality from the exact variance. That holds for any distribution and any number of runs, so the
false-alarm rate of all checks together is proven, not approximate.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network import Network
from kinetics.runs import Ensemble
from kinetics.sampling import SamplingMethod
from kinetics.solving import Distribution, SolvingMethod, Transient
from kinetics.solving.transient import MANY_STEPS
from kinetics.solving.uniformisation import DiscreteChain, mixtures
from kinetics.support.arrays import Floats, Ints, rising_times, whole_number
from kinetics.support.tables import text_table

if TYPE_CHECKING:
    from collections.abc import Iterator

FALSE_ALARM = 1e-6
EXPECTED = 5.0  # runs in a state that is checked on its own
LEVELS = 64  # counts of a species at which its distribution function is checked
EVENTS = 5000  # waits that are checked
PATHS = 0.1  # of the runs, at most, are made once more event by event to see the waits
FINE = 2.0**32  # waits must be right to finer steps than random numbers of 32 bits allow


@dataclass(frozen=True)
class Check:
    """A figure found in the runs, its exact value, and by how much chance may make them differ."""

    what: str
    found: float
    expected: float
    allowed: float

    @property
    def severity(self) -> float:
        """Difference over what is allowed; above 1 is no chance."""
        difference = abs(self.found - self.expected)
        return difference / self.allowed if self.allowed > 0 else (np.inf if difference > 0 else 0.0)


@dataclass(frozen=True)
class Verification:
    """The outcome of all checks of a sampler.

    false_alarm : largest probability that a correct sampler fails any check
    error : error of the exact probabilities, which the checks allow for
    """

    method: str
    runs: int
    seed: int
    false_alarm: float
    error: float
    checks: tuple[Check, ...]

    @property
    def failures(self) -> tuple[Check, ...]:
        """The checks that failed, the worst first."""
        return tuple(sorted((c for c in self.checks if c.severity > 1), key=lambda c: -c.severity))

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return not self.failures

    def __str__(self) -> str:
        head = (
            f"{self.method}: {len(self.checks)} checks on {self.runs} runs (seed {self.seed}), "
            f"{len(self.failures)} failed; a right sampler fails one with probability {self.false_alarm:g} at most"
        )
        if self.passed:
            return head
        rows = [(c.what, f"{c.found:.6g}", f"{c.expected:.6g}", f"{c.allowed:.2g}") for c in self.failures[:10]]
        return f"{head}\n{text_table(('check', 'found', 'exact', 'chance'), rows)}"


def verify(
    network: Network,
    method: SamplingMethod,
    initial: ArrayLike,
    times: ArrayLike,
    runs: int = 20_000,
    seed: int = 0,
    false_alarm: float = FALSE_ALARM,
    solver: SolvingMethod | None = None,
) -> Verification:
    """Check runs of `method` against the exact probabilities at `times` (T,), tu.

    solver : Transient() by default; give FiniteStateProjection() where the state space is infinite

    The checks are of the probability of every state that is likely enough, of the distribution function of every
    species, of means and mean products of all species at each time and from one time to the next, and of waits times
    exit rates, which must be exponential, down to steps too fine for 32-bit random numbers. Waits are those of the
    method's paths; of an object that has `name` and `simulate` alone, without the base class, only counts are checked.
    """
    grid = rising_times(times)
    n = whole_number("runs", runs, 100)
    if not 0 < false_alarm < 1:
        raise ValueError(f"false_alarm = {false_alarm}; expected a probability")
    solution = (Transient() if solver is None else solver).solve(network, initial, grid)
    sample = method.simulate(network, initial, grid, runs=n, seed=seed)
    means = [*_counts_at_each_time(solution, sample), *_over_time(solution, sample)]
    waits = _waits(network, method, initial, float(grid[-1]), seed, int(PATHS * n))
    depth = log(2.0 * (len(means) + len(waits)) / false_alarm)
    checks = [mean.check(n, depth, solution.error) for mean in means]
    checks += [Check(what, gap, 0.0, sqrt(depth / (2 * size))) for what, gap, size in waits]
    return Verification(method.name, n, seed, false_alarm, solution.error, tuple(checks))


@dataclass(frozen=True)
class _Mean:
    """Mean of a function over the runs and exactly, its exact variance and the width of its range."""

    what: str
    found: float
    expected: float
    variance: float
    width: float

    def check(self, n: int, depth: float, error: float) -> Check:
        """Bernstein's inequality, solved for the deviation; the solution's own error is added to both moments."""
        variance = max(self.variance, 0.0) + error * self.width**2
        third = self.width * depth / (3.0 * n)
        chance = third + sqrt(third**2 + 2.0 * variance * depth / n)
        return Check(self.what, self.found, self.expected, chance + error * self.width if self.width else 0.0)


def _counts_at_each_time(solution: Distribution, sample: Ensemble) -> Iterator[_Mean]:
    n, names = sample.runs, solution.network.species
    states = solution.space.states
    tops = np.maximum(states.max(axis=0), 1)
    for t, time in enumerate(solution.times):
        p, at = solution.probabilities[t], f"at {time:g} tu"
        rows = solution.space.index_of(sample.counts[:, t])
        share = np.bincount(rows[rows >= 0], minlength=len(states)) / n
        likely = np.flatnonzero(n * p >= EXPECTED)
        for i in likely:
            yield _Mean(f"state {states[i].tolist()} {at}", share[i], p[i], p[i] * (1 - p[i]), 1.0)
        rest = max(1.0 - float(p[likely].sum()), 0.0)
        yield _Mean(f"all other states {at}", 1.0 - float(share[likely].sum()), rest, rest * (1 - rest), 1.0)
        # What no chain can do is not left to chance.
        yield _Mean(
            f"states that cannot be {at}", float((rows < 0).mean()), 0.0, 0.0, 0.0 if solution.is_complete else 1.0
        )
        # Runs may go where a projection has no states; such counts are cut off, on both sides of the comparison.
        counts = np.minimum(sample.counts[:, t], tops)
        for s, name in enumerate(names):
            yield from _distribution_function(f"{name} {at}", counts[:, s], states[:, s], p)
            yield _moment(f"mean of {name} {at}", counts[:, s], states[:, s], p, tops[s])
            for other in range(s, len(names)):
                products = counts[:, s] * counts[:, other].astype(float)
                exact = states[:, s] * states[:, other].astype(float)
                yield _moment(f"mean of {name} * {names[other]} {at}", products, exact, p, tops[s] * float(tops[other]))


def _distribution_function(what: str, counts: Ints, copies: Ints, p: Floats) -> Iterator[_Mean]:
    below = np.cumsum(np.bincount(copies, p))
    found = np.cumsum(np.bincount(counts, minlength=below.size)) / counts.size
    inside = np.flatnonzero((below > 0) & (below < 1 - 1e-12))
    for level in inside[:: max(1, -(-inside.size // LEVELS))]:
        exact = float(below[level])
        yield _Mean(f"at most {level} of {what}", float(found[level]), exact, exact * (1 - exact), 1.0)


def _moment(what: str, values: Any, exact_values: Any, p: Floats, top: float) -> _Mean:
    mean = float(p @ exact_values)
    variance = float(p @ (exact_values - mean) ** 2)
    return _Mean(what, float(values.mean()), mean, variance, float(top))


def _over_time(solution: Distribution, sample: Ensemble) -> Iterator[_Mean]:
    """Mean products of a count with one at the next time: from the distribution at the first, weighted by the count."""
    if not solution.is_complete or solution.times.size < 2:
        return
    chain = DiscreteChain.of(solution.space.generator())
    states, names = solution.space.states.astype(float), solution.network.species
    tops = np.maximum(states.max(axis=0), 1.0)
    for t in range(solution.times.size - 1):
        gap = float(solution.times[t + 1] - solution.times[t])
        if chain.rate * gap > MANY_STEPS:
            continue
        for s, name in enumerate(names):
            weighted = solution.probabilities[t] * states[:, s]
            squares = weighted * states[:, s]
            if weighted.sum() == 0.0:
                continue
            later, _, error = mixtures(chain, weighted / weighted.sum(), [gap], 1e-13)
            later_squares, _, _ = mixtures(chain, squares / squares.sum(), [gap], 1e-13)
            for other, other_name in enumerate(names):
                mean = float(weighted.sum() * (later[0] @ states[:, other]))
                square = float(squares.sum() * (later_squares[0] @ states[:, other] ** 2))
                found = (sample.counts[:, t, s] * sample.counts[:, t + 1, other].astype(float)).mean()
                what = f"mean of {name} at {solution.times[t]:g} * {other_name} at {solution.times[t + 1]:g} tu"
                top = float(tops[s] * tops[other])
                slack = error * top**2 + 1e-12 * square
                yield _Mean(what, float(found), mean, square - mean**2 + slack, top)


def _waits(
    network: Network, method: SamplingMethod, initial: ArrayLike, end: float, seed: int, paths: int
) -> list[tuple[str, float, int]]:
    """What was looked at, the largest gap between the distribution functions, and the number of waits.

    In units of the exit rate, the runs put one after the other are a Poisson process of rate 1, whatever cuts them.
    """
    if not isinstance(method, SamplingMethod):  # counts alone
        return []
    waits_of_runs, finest, left, n_events, run = [], [], 0.0, 0, 0
    while n_events < EVENTS and run < paths:
        path = method.sample_path(network, initial, end, seed=seed, run=run)
        exits = network.propensities(path.states).sum(axis=1)
        elapsed = exits * np.diff(np.concatenate([[0.0], path.times, [path.end]]))
        elapsed[0] += left  # what the run before had waited when it was cut
        waits_of_runs.append(elapsed[:-1])
        left = float(elapsed[-1])
        finest.append(np.spacing(path.times) * exits[:-1] * FINE < 0.01)
        n_events += path.times.size
        run += 1
    waits, is_fine = np.concatenate(waits_of_runs)[:EVENTS], np.concatenate(finest)[:EVENTS]
    if waits.size < EXPECTED:
        return []
    checks = [("waits are exponential", _gap(-np.expm1(-waits)), waits.size)]
    # Where the clock itself is coarser than 32 bits there is nothing to see.
    survivals = np.exp(-waits[is_fine & (waits < log(FINE) / 2)])
    if survivals.size >= EXPECTED:
        checks.append(("waits are finer than 32 bits", _gap(survivals * FINE % 1.0), survivals.size))
    return checks


def _gap(values: Floats) -> float:
    """Largest distance of the empirical distribution function from the uniform one."""
    ordered = np.sort(values)
    steps = np.arange(ordered.size + 1) / ordered.size
    return float(max((steps[1:] - ordered).max(), (ordered - steps[:-1]).max()))


def detectable(probability: float, runs: int, checks: int = 1000, false_alarm: float = FALSE_ALARM) -> float:
    """Smallest error in a probability that `runs` runs are sure to show, up to one time in 1 / false_alarm."""
    depth = log(2.0 * checks / false_alarm)
    third = depth / (3.0 * runs)
    return 2.0 * (third + sqrt(third**2 + 2.0 * probability * (1 - probability) * depth / runs))
