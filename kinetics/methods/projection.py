"""Finite state projection: the master equation on the states that matter, which move along with the probability."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.arrays import Floats, Ints, rising_times
from kinetics.memory import check_memory
from kinetics.methods.distribution import Distribution
from kinetics.methods.poisson import ROUNDOFF
from kinetics.methods.uniformisation import MAX_STEPS, DiscreteChain, Mixtures, mixtures
from kinetics.network import Network
from kinetics.states import MAX_STATES, Search, StateSpace, TooManyStatesError

MIN_TOLERANCE = 1e-13
FIRST_STEPS = 32.0  # uniformised steps of the first window; each window that goes well makes the next one longer
MOST_STEPS = 20_000.0
MOST_LAYERS = 8  # events that the states are extended by at a time
SMALLEST = 1e-300
SHARE = 1e-3  # of the tolerance that the Poisson windows may leave out
SETTLED = 0.1  # of the allowed loss: states that lose less than this together are not extended


@dataclass(frozen=True)
class FiniteStateProjection:
    """Probabilities on a set of states that follows the probability (Munsky & Khammash 2006), of a space without end.

    In windows of time, mass that leaves the set is lost to a sink; where that is too much, the states from which it
    flowed are extended and the window is done again. After a window those states are dropped that hold little mass and
    that little mass went through, so that bottlenecks stay.

    tolerance : largest probability that may be lost until the last time
    max_states : of the set, and of all sets together; more are refused
    """

    name: ClassVar[str] = "fsp"

    tolerance: float = 1e-9
    max_states: int = MAX_STATES

    def __post_init__(self) -> None:
        if not MIN_TOLERANCE <= self.tolerance < 1:
            raise ValueError(f"tolerance = {self.tolerance}; expected between {MIN_TOLERANCE:.0e} and 1")

    def solve(self, network: Network, initial: ArrayLike, times: ArrayLike) -> Distribution:
        """Probabilities of the states that matter at `times`, tu, rising, starting from one state at time 0.

        They are lower bounds but for rounding; `error` is all that was lost, and rounding.
        """
        network.known_rates  # noqa: B018
        grid = rising_times(times)
        if not grid.size:
            raise ValueError("times is empty; give at least one time")
        front = _Front(network, network.state(initial), grid, self.tolerance, self.max_states)
        while front.time < grid[-1]:
            try:
                front.advance()
            except TooManyStatesError:
                raise TooManyStatesError(front.too_many()) from None
        return front.distribution()


class _Window(NamedTuple):
    """A window of time, solved on one set of states.

    end : tu; asked : times before it, of those asked for
    solved : probabilities at these times and at the end
    leaving, traffic : (N,) probability that went from each state out of the set, and to anywhere
    """

    states: Ints
    end: float
    asked: Floats
    solved: Mixtures
    leaving: Floats
    traffic: Floats


class _Front:
    """States and probabilities now, and what was found at the times asked for."""

    def __init__(self, network: Network, start: Ints, grid: Floats, tolerance: float, max_states: int) -> None:
        self.network, self.grid, self.tolerance, self.max_states = network, grid, tolerance, max_states
        self.time, self.states, self.mass = 0.0, start[None, :].copy(), np.ones(1)
        self.rounding, self.steps = 0.0, 0.0
        self.length, self.layers = FIRST_STEPS, 1
        self.seen = Search(network, self.states, max_states)
        self.found: list[tuple[Ints, Floats]] = []
        if grid[0] == 0.0:
            self._note(self.states, self.mass)

    def advance(self) -> None:
        """Solve one window, with more states where too much is lost, and drop those that do not matter."""
        search = Search(self.network, self.states, self.max_states)
        _extend(search, np.ones(len(search), dtype=bool), self.layers)
        is_first = True
        while True:
            window = self._solve(search)
            # As much may flow out as may be dropped afterwards; a tenth is left for the Poisson windows.
            allowed = 0.45 * self.tolerance * (window.end - self.time) / self.grid[-1]
            if self.mass.sum() - window.solved.probabilities[-1].sum() <= allowed:
                break
            is_first = False
            _extend(search, _largest(window.leaving, SETTLED * allowed), self.layers)
            self.layers = min(self.layers + 1, MOST_LAYERS)
            self.length = max(self.length / 1.5, FIRST_STEPS)
        if is_first:
            self.layers = max(self.layers - 1, 1)
            self.length = min(1.5 * self.length, MOST_STEPS)
        for probabilities in window.solved.probabilities[:-1]:
            self._note(window.states, probabilities)
        self.time, mass = window.end, window.solved.probabilities[-1]
        matters = _largest(mass + window.traffic, allowed)
        self.states, self.mass = window.states[matters], mass[matters]
        self.rounding += window.solved.error
        if self.time == self.grid[-1]:
            self._note(self.states, self.mass)

    def _solve(self, search: Search) -> _Window:
        space = StateSpace(self.network, search.states.copy(), np.zeros(len(search), dtype=bool))
        rows, columns, rates, leaks = space.transitions()
        exits = np.bincount(rows, rates, minlength=len(space)) + leaks
        chain = DiscreteChain.from_rates(rows, columns, rates, exits)
        end = min(self.time + self.length / chain.rate, float(self.grid[-1]))
        self.steps += chain.rate * (end - self.time)
        if end == self.time or self.steps > MAX_STEPS:
            raise ValueError(
                f"the chain is too stiff for a projection: over {MAX_STEPS} steps, and only {self.time:.4g} of "
                f"{self.grid[-1]:g} tu done; ask for earlier times, lower the fastest rates, or sample"
            )
        start = np.zeros(len(space))
        start[: self.mass.size] = self.mass
        asked = self.grid[(self.grid > self.time) & (self.grid < end)]
        tolerance = max(SHARE * self.tolerance * (end - self.time) / float(self.grid[-1]), SMALLEST)
        solved = mixtures(chain, start, [*(asked - self.time), end - self.time], tolerance)
        stays = solved.stays / chain.rate
        return _Window(space.states, end, asked, solved, leaks * stays, exits * stays)

    def _note(self, states: Ints, mass: Floats) -> None:
        held = mass > 0.0
        self.found.append((self.seen.add(np.ascontiguousarray(states[held])), mass[held]))

    def distribution(self) -> Distribution:
        """What was found, on the union of all sets."""
        n = len(self.seen)
        check_memory(f"{n} states at {self.grid.size} times", 8.0 * n * self.grid.size, "ask for fewer times")
        probabilities = np.zeros((self.grid.size, n))
        for row, (places, mass) in zip(probabilities, self.found, strict=True):
            row[places] = mass
        lost = float((1.0 - probabilities.sum(axis=1)).max())
        space = StateSpace(self.network, self.seen.states.copy(), np.zeros(n, dtype=bool))
        error = max(lost, 0.0) + self.rounding + ROUNDOFF * (2 * len(self.found) + np.log2(n) + 20)
        return Distribution(space, self.grid, probabilities, error, is_complete=False)

    def too_many(self) -> str:
        """How far it came, and how the likely states spread."""
        low, high = self.states.min(axis=0), self.states.max(axis=0)
        spread = sorted(zip(high - low, self.network.species, low, high, strict=True), reverse=True)[:3]
        ranges = ", ".join(f"{name} {a} to {b}" for _, name, a, b in spread)
        return (
            f"over {self.max_states} states matter: {len(self.states)} held all but {self.tolerance:.0e} of the "
            f"probability at {self.time:.4g} of {self.grid[-1]:g} tu ({ranges}), and more were needed; ask for earlier "
            f"times, a larger tolerance or fewer copies, sample with the direct method instead, or raise max_states"
        )


def _extend(search: Search, chosen: NDArray[np.bool_], layers: int) -> None:
    """Add what the chosen states (N,) lead to in so many events."""
    begin, is_stopped = 0, ~chosen
    for _ in range(layers):
        end = len(search)
        search.go_on(begin, end, is_stopped)
        begin, is_stopped = end, np.zeros(0, dtype=bool)


def _largest(values: Floats, rest: float) -> NDArray[np.bool_]:
    """Where the largest values are; all others together are at most `rest`."""
    order = np.argsort(values)
    is_large = np.ones(values.size, dtype=bool)
    is_large[order[np.cumsum(values[order]) <= rest]] = False
    return is_large
