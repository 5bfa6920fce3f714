"""Finite state projection: the master equation on a set of likely states that moves along with the probability."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from math import log2
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.transient.base import SolvingMethod
from kinetics.markov.transient.distribution import Distribution
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.search import MAX_STATES, Search, TooManyStatesError
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.uniformisation import MAX_STEPS, DiscreteChain, Mixtures, mixtures
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints
from kinetics.support.cli.progress import limit_in_words, stage
from kinetics.support.memory import check_memory

ADVICE = "Ask for earlier times, a larger tolerance or smaller counts, sample instead, or raise max_states"
FIRST_STEPS = 32.0  # uniformised steps of the first window; each window that goes well makes the next one longer
MOST_STEPS = 20_000.0
MOST_LAYERS = 8  # events that the states are extended by at a time
SMALLEST = 1e-300
SHARE = 1e-3  # of the tolerance that the Poisson windows may leave out
MINOR = 0.1  # of the allowed loss: states that lose less than this together are not extended
TRIAL = 0.02  # of the work allowed: done before the rest is forecast, to see whether rates fall or the law settles
BUILDING = 200.0  # uniformised steps that cost as much as building their chain
WINDOW_SECONDS = 1e-3  # that a window takes however few its states, on a common machine


@dataclass(frozen=True)
class FiniteStateProjection(SolvingMethod):
    """Finite state projection: the master equation on a finite set of states that moves with the probability.

    The state space may be infinite. Time is cut into windows. Mass that leaves the set within a window is lost to a
    sink; if too much is lost, the set is extended around the states from which it flowed and the window is done
    again. After a window, states are dropped if they hold little mass and little mass went through them, so that
    bottlenecks stay. Once the distribution has settled it is kept as it is.

    The error is a proven bound, except where a rate law cannot be bounded.

    Source: Munsky & Khammash (2006), doi:10.1063/1.2145882, with sets that move. Cost: about (exit rate of the likely
    states) * (last time) steps over their transitions. Choose it where more states can be reached than can be listed,
    or far more than are likely.

    tolerance : largest probability that may be lost, or shift after the distribution has settled, until the last time
    max_states : largest size of one set, and of all sets together; more states are refused
    max_seconds : work estimated to take longer is refused
    trial : share of `max_seconds` that is spent before that estimate: sets of states often shrink after the beginning

    >>> from kinetics import FiniteStateProjection, Network, solve
    >>> turnover = Network.from_text("0 <-> A, 5, 1")  # without limit: Poisson, with mean 5 (1 - exp(-t))
    >>> found = solve(turnover, FiniteStateProjection(), {"A": 0}, [1.0])
    >>> found.mean().round(6).tolist(), found.error < 1e-9, found.is_bound
    ([[3.160603]], True, True)
    """

    name: ClassVar[str] = "fsp"
    least_tolerance: ClassVar[float | None] = 1e-13

    tolerance: float = 1e-9
    max_states: int = MAX_STATES
    max_seconds: float = 7200.0
    trial: float = TRIAL

    def distribution(self, network: Network, start: Ints, grid: Floats) -> Distribution:
        """Probabilities of the states kept; `error` is the lost probability, the last drift, and rounding."""
        front = _Front(network, start[None, :], grid, self)
        while front.time < grid[-1]:
            try:
                front.advance()
            except TooManyStatesError:
                raise TooManyStatesError.of(front.too_many(), ADVICE) from None
        return front.distribution()


class _Window(NamedTuple):
    """A window of time, solved on one set of states.

    chain : of these states
    end : tu; asked : times before it, of those asked for
    solved : probabilities at these times and at the end
    leaks : (N,) 1/tu, out of the set
    leaving, traffic : (N,) probability that went from each state out of the set, and to anywhere
    """

    states: Ints
    chain: DiscreteChain
    end: float
    asked: Floats
    solved: Mixtures
    leaks: Floats
    leaving: Floats
    traffic: Floats

    def unrest(self) -> tuple[float, float]:
        """At the end, 1/tu: the sum of |p Q| with all flow out of the set, and the flow of probability."""
        mass = self.solved.probabilities[-1]
        outflow = self.chain.arrays.exits * mass
        # Not `leaks @ mass`: BLAS would wake threads that cost more than they save.
        change = self.chain.rate * float(np.abs(self.chain.inflows @ mass - outflow).sum())
        return change + float((self.leaks * mass).sum()), self.chain.rate * float(outflow.sum())


class _Front:
    """States and probabilities now, and what was found at the times asked for."""

    def __init__(self, network: Network, begins: Ints, grid: Floats, method: FiniteStateProjection) -> None:
        self.network, self.grid, self.method = network, grid, method
        self.tolerance, self.max_states = method.tolerance, method.max_states
        self.time, self.states, self.mass = 0.0, begins.copy(), np.full(len(begins), 1.0 / len(begins))
        self.rounding, self.drift, self.is_certified = 0.0, 0.0, True
        self.steps, self.seconds = 0.0, 0.0
        self.past: list[tuple[float, float, float]] = []  # steps, time and rate at each window
        self.length, self.layers = FIRST_STEPS, 1
        self.seen = Search(network, self.states, method.max_states)
        self.found: list[tuple[Ints, Floats]] = []
        if grid[0] == 0.0:
            self._note(self.states, self.mass)

    def advance(self) -> None:
        """Solve one window, with more states where too much is lost, and drop those that do not matter."""
        search = Search(self.network, self.states, self.max_states)
        extend(search, np.ones(len(search), dtype=bool), self.layers)
        is_first = True
        while True:
            window = self._solve(search)
            # As much may flow out as may be dropped afterwards; a tenth is left for the Poisson windows.
            allowed = 0.45 * self.tolerance * (window.end - self.time) / self.grid[-1]
            # What is missing from the sum may be rounding, and no more states would make that less; what all steps
            # of the window let out is no less than what is lost, and has no such floor.
            missing = self.mass.sum() - window.solved.probabilities[-1].sum()
            if min(missing, window.leaving.sum()) <= allowed:
                break
            is_first = False
            extend(search, largest(window.leaving, MINOR * allowed), self.layers)
            self.layers = min(self.layers + 1, MOST_LAYERS)
            self.length = max(self.length / 1.5, FIRST_STEPS)
        if is_first:
            self.layers = max(self.layers - 1, 1)
            self.length = min(1.5 * self.length, MOST_STEPS)
        for probabilities in window.solved.probabilities[:-1]:
            self._note(window.states, probabilities)
        self.time, mass = window.end, window.solved.probabilities[-1]
        # Drop states with little probability now and little that passed through in the window.
        matters = largest(mass + window.traffic, allowed)
        self.states, self.mass = window.states[matters], mass[matters]
        self.rounding += window.solved.error
        if (self.grid == self.time).any():
            self._note(self.states, self.mass)
        self._rest(window)

    def _rest(self, window: _Window) -> None:
        """Keep the distribution as it is until the last time, where its drift until then is small enough.

        d/dt of p(t) - p is (p(t) - p) Q + p Q, and exp(Q t) enlarges no difference, so p(t) departs from p by at most
        t times the sum of |p Q|, all flow out of the set included. Small enough is what may be lost, or what the steps
        saved would round.
        """
        left, chain = float(self.grid[-1]) - self.time, window.chain
        if not left:
            return
        change, flow = window.unrest()
        drift, rounding = 1.01 * left * change, chain.rounding(0, left * flow)
        allowed = 0.9 * self.tolerance * left / self.grid[-1]
        if drift > max(allowed, rounding) or rounding > max(allowed, chain.rounding(MAX_STEPS)):
            return
        self._note(window.states, window.solved.probabilities[-1])
        self.found += self.found[-1:] * (int((self.grid > self.time).sum()) - 1)
        self.drift += drift
        self.rounding += rounding
        self.time = float(self.grid[-1])

    def _check_work(self, chain: DiscreteChain, steps: float) -> None:
        """Add a window of so many steps to the work; refuse if that and the least that is to come are too much."""
        left = float(self.grid[-1]) - self.time
        self.past.append((self.steps, self.time, chain.rate))
        # Rates that fall, mostly fall ever more slowly: at the pace of the latter half, the steps come out too few.
        _, before, rate = self.past[bisect_left(self.past, (self.steps / 2,))]
        seconds = (steps + BUILDING) * chain.step_seconds + WINDOW_SECONDS
        self.steps += steps
        self.seconds += seconds
        stage(f"projection: {self.time:.4g} of {self.grid[-1]:g} on {chain.size} states", self.time / self.grid[-1])
        fall = max((rate - chain.rate) / (self.time - before), 0.0) if self.time > before else 0.0
        lasting = min(left, chain.rate / fall) if fall > 0 else left
        total = self.steps + max((chain.rate - 0.5 * fall * lasting) * lasting - steps, 0.0)
        cost = self.seconds + (total - self.steps) * seconds / steps
        limit = self.method.max_seconds
        is_long = self.seconds > self.method.trial * limit and cost > limit
        is_stiff = self.steps > TRIAL * MAX_STEPS and total > MAX_STEPS
        if is_long or is_stiff or self.time + steps / chain.rate == self.time:
            raise ValueError(
                f"the chain is too stiff or too large for a projection: {self.time:.4g} of {self.grid[-1]:g} took "
                f"{self.steps:.3g} steps on up to {chain.size} states, and all would take {total:.3g} or more, about "
                f"{cost:.3g} s; at most {MAX_STEPS} steps and {limit_in_words(limit)}, which may be raised; ask for "
                f"earlier times, lower the fastest rates, use the method 'transient' if there are few states, or sample"
            )

    def _solve(self, search: Search) -> _Window:
        space = StateSpace(self.network, search.states.copy(), np.zeros(len(search), dtype=bool))
        jumps = space.transitions()
        leaks, exits = jumps.leaks, jumps.exits
        self.is_certified &= jumps.is_certified
        # An exit sums what leads on within the set and out of it: no more than there are channels.
        chain = DiscreteChain.of(jumps, most_out=len(self.network.channels))
        end = min(self.time + self.length / chain.rate, float(self.grid[-1]))
        self._check_work(chain, min(self.length, chain.rate * (float(self.grid[-1]) - self.time)))
        start = np.zeros(len(space))
        start[: self.mass.size] = self.mass
        asked = self.grid[(self.grid > self.time) & (self.grid < end)]
        tolerance = max(SHARE * self.tolerance * (end - self.time) / float(self.grid[-1]), SMALLEST)
        solved = mixtures(chain, start, [*(asked - self.time), end - self.time], tolerance)
        stays = solved.stays / chain.rate
        return _Window(space.states, chain, end, asked, solved, leaks, leaks * stays, exits * stays)

    def _note(self, states: Ints, mass: Floats) -> None:
        held = mass > 0.0
        self.found.append((self.seen.add(np.ascontiguousarray(states[held])), mass[held]))

    def distribution(self) -> Distribution:
        """The distribution at all times, on the union of all state sets."""
        n = len(self.seen)
        check_memory(f"{n} states at {self.grid.size} times", 8.0 * n * self.grid.size, "ask for fewer times")
        probabilities = np.zeros((self.grid.size, n))
        for row, (places, mass) in zip(probabilities, self.found, strict=True):
            row[places] = mass
        lost = float((1.0 - probabilities.sum(axis=1)).max())
        space = StateSpace(self.network, self.seen.states.copy(), np.zeros(n, dtype=bool))
        error = max(lost, 0.0) + self.drift + self.rounding + ROUNDOFF * (2 * len(self.found) + log2(n) + 20)
        return Distribution(space, self.grid, probabilities, error, self.is_certified, is_complete=False)

    def too_many(self) -> str:
        """A sentence on how far the projection came, and how the likely states spread."""
        low, high = self.states.min(axis=0), self.states.max(axis=0)
        spread = sorted(zip(high - low, self.network.species, low, high, strict=True), reverse=True)[:3]
        ranges = ", ".join(f"{name} {a} to {b}" for _, name, a, b in spread)
        return (
            f"over {self.max_states} states matter: {len(self.states)} held all but {self.tolerance:.0e} of the "
            f"probability at {self.time:.4g} of {self.grid[-1]:g} ({ranges}), and more were needed"
        )


def extend(search: Search, chosen: NDArray[np.bool_], layers: int) -> None:
    """Add what the chosen states (N,) lead to in so many events."""
    begin, is_stopped = 0, ~chosen
    for _ in range(layers):
        end = len(search)
        search.go_on(begin, end, is_stopped)
        begin, is_stopped = end, np.zeros(0, dtype=bool)


def largest(values: Floats, rest: float) -> NDArray[np.bool_]:
    """The places of the largest values; all others sum to at most `rest`."""
    order = np.argsort(values)
    is_large = np.ones(values.size, dtype=bool)
    is_large[order[np.cumsum(values[order]) <= rest]] = False
    return is_large
