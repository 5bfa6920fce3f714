"""The master equation on millions of states: none of their rates is stored, and only the likely ones are followed."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics.markov.transient.base import SolvingMethod
from kinetics.markov.transient.distribution import Distribution
from kinetics.markov.transient.packed import Judge
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.windows import Limits, Windows, WindowsCost, state_bytes
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints
from kinetics.support.cli.progress import forecast, limit_in_words
from kinetics.support.memory import check_memory
from kinetics.support.tables import rough

LARGE = 20_000  # states at once, from which on the rest is forecast
TRIALS = (3e-2, 3e-3)  # tolerances of the forecast's trial runs
MOST_STATES = 30_000_000


class InterruptedSolutionError(KeyboardInterrupt):
    """Ctrl-C during a solution.

    finished : the distribution at the times that were reached, None if there are none

    >>> from kinetics.markov.transient import InterruptedSolutionError
    >>> try:
    ...     raise InterruptedSolutionError  # as `MatrixFree().solve(...)` does at Ctrl-C
    ... except InterruptedSolutionError as stopped:
    ...     print(stopped.finished)
    None
    """

    finished: Distribution | None = None


@dataclass(frozen=True)
class MatrixFree(SolvingMethod):
    """Uniformisation without a stored matrix, on a set of likely states that moves with the probability.

    A state is one integer, its counts side by side in the bits; propensities are computed anew in each step. Time is
    cut into windows, each uniformised at the largest exit rate of its states. The set grows every few steps, before
    the probability gets there; what leaves it and what is dropped after a window is lost, and the error counts it.
    Two threads share the work. Ctrl-C raises `InterruptedSolutionError`, which holds what was finished.

    The error is a proven bound, except where a rate law cannot be bounded.

    Source: Henzinger, Mateescu & Wolf (2009), doi:10.1007/978-3-642-02658-4_27, for sets that move along; the bound is
    that of Munsky & Khammash (2006), doi:10.1063/1.2145882. Cost: about 1 ns for every likely state, channel and
    uniformised step; 4 bytes for every likely state and channel, and 120 for every state. Choose it for some 10,000 to
    30 million states whose counts fit into 62 bits together. Rates that depend on time are refused.

    tolerance : largest probability that may be lost until the last time
    max_states : largest number of states at once; more are refused
    max_seconds : work forecast to take longer, CPU time, is refused before it starts, or soon after

    >>> from kinetics import MatrixFree, Network, solve
    >>> turnover = Network.from_text("0 <-> A, 5, 1")  # without limit: Poisson, with mean 5 (1 - exp(-t))
    >>> found = solve(turnover, MatrixFree(), {"A": 0}, [1.0])
    >>> found.mean().round(6).tolist(), found.error < 2e-9, found.is_bound
    ([[3.160603]], True, True)
    """

    name: ClassVar[str] = "matrix-free"
    least_tolerance: ClassVar[float | None] = 1e-12

    tolerance: float = 1e-9
    max_states: int = MOST_STATES
    max_seconds: float = 7200.0

    def distribution(self, network: Network, start: Ints, grid: Floats) -> Distribution:
        """Probabilities of the likely states; `error` is the lost probability, and rounding."""
        try:
            windows = self.followed(network, start, grid)
        except _InterruptedError as interrupted:
            stopped = InterruptedSolutionError()
            if interrupted.windows.found:
                stopped.finished = _distribution(interrupted.windows, start)
            raise stopped from None
        return _distribution(windows, start)

    def followed(self, network: Network, start: Ints, grid: Floats, judge: Judge | None = None) -> Windows:
        """The chain followed to the last of the times; judge : verdicts on states, which stop it.

        Once it has grown large, trial runs at large tolerances forecast time and memory.
        """
        limits = Limits(self.tolerance, self.max_states, self.max_seconds)
        with ThreadPoolExecutor(1) as pool:
            windows = Windows(network, start, grid, limits, pool, judge)
            is_forecast = self.tolerance >= TRIALS[-1]
            try:
                while not windows.is_over:
                    windows.advance()
                    if not is_forecast and windows.mass.size > LARGE:
                        is_forecast = True
                        trials = [limits._replace(tolerance=each) for each in TRIALS]
                        self._forecast(*(Windows(network, start, grid, each, pool, judge, 1.0) for each in trials))
            except KeyboardInterrupt:
                raise _InterruptedError(windows) from None
        return windows

    def _forecast(self, loose: Windows, tight: Windows) -> None:
        """Say what the work will take, from trial runs at large tolerances; refuse what is too much."""
        for trial in (loose, tight):
            while not trial.is_over:
                trial.advance()
        seconds, n_states = expected(loose.cost, tight.cost, self.tolerance)
        needed = state_bytes(tight.chain.n_channels, len(tight.packing.law_channels)) * n_states
        what = f"about {rough(n_states)} states at once, {needed / 2**30:.2g} GB"
        if seconds > self.max_seconds:
            raise ValueError(
                f"the matrix-free method would take about {seconds:.3g} s of CPU time ({what}); "
                f"{limit_in_words(self.max_seconds)}; raise it, ask for earlier times or a larger tolerance, or sample"
            )
        check_memory(f"{what}: this", needed, "ask for earlier times, a larger tolerance or smaller counts")
        forecast(seconds, what)


class _InterruptedError(Exception):
    """Ctrl-C during windows, which hold what was found before."""

    def __init__(self, windows: Windows) -> None:
        super().__init__()
        self.windows = windows


def expected(loose: WindowsCost, tight: WindowsCost, tolerance: float) -> tuple[float, float]:
    """CPU time, s, and states at once at a tolerance, from trial runs at the two of `TRIALS`.

    Of a Gaussian, the likely states are an ellipsoid whose volume is a power of log(1 / tolerance). An estimate,
    mostly within a factor of two.

    >>> cost, states = expected(WindowsCost(200, 4e5, 1000, 3000, 0.02), WindowsCost(200, 7e5, 2000, 4000, 0.03), 1e-9)
    >>> round(cost, 2), round(states)
    (0.12, 17201)
    """
    depths = -np.log([*TRIALS, tolerance])
    power = np.log(tight.kept / loose.kept) / np.log(depths[1] / depths[0])
    kept = tight.kept * float(depths[2] / depths[1]) ** max(float(power), 0.0)
    return tight.seconds / tight.work * 1.2 * tight.steps * kept, 1.5 * kept


def _distribution(windows: Windows, start: Ints) -> Distribution:
    """The distribution at the times that were reached, on all states that are likely at some of them."""
    found, packing = windows.found, windows.packing
    first = packing.keys(start[None, :])
    keys = np.unique(np.concatenate([each.keys for each in found])) if len(found) > 1 else found[0].keys
    keys = np.concatenate([first, keys[keys != first[0]]])
    n, n_species = keys.size, start.size
    advice = "ask for fewer times, or a larger tolerance"
    check_memory(f"{n} states at {len(found)} times", 8.0 * n * (len(found) + 2 * n_species), advice)
    probabilities = np.zeros((len(found), n))
    for row, each in zip(probabilities, found, strict=True):
        is_first = each.keys == first[0]
        row[0] = each.mass[is_first].sum()
        row[1 + np.searchsorted(keys[1:], each.keys[~is_first])] = each.mass[~is_first]
    error = max(windows.error(each) for each in found)
    space = StateSpace(windows.network, packing.counts(keys), np.zeros(n, dtype=bool))
    is_bound = bool(np.isfinite(windows.chain.rate_error))
    return Distribution(space, windows.grid[: len(found)], probabilities, error, is_bound, is_complete=False)
