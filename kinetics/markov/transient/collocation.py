"""Radau collocation in steps that grow with time, for chains of thousands of states with rates many decades apart."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, log2, log10, sqrt
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from kinetics.markov.transient.base import ListingMethod, ProbabilityTable
from kinetics.markov.transient.certificate import ABOVE, Entries, best_entries
from kinetics.markov.transient.defect import FixedPointChain, exit_rates, integrals_of, value_at
from kinetics.markov.transient.dense import LARGEST
from kinetics.markov.transient.radau import RadauStep, fill
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.transitions import Transitions
from kinetics.support.arrays import Floats, Ints
from kinetics.support.cli.progress import forecast, limit_in_words
from kinetics.support.memory import check_memory
from kinetics.support.packages import sparse

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MOST_EVENTS = 1e15  # fastest rate * last time; beyond, sparse LU in doubles loses too much of the slow rates
SHARE = 1 / 16  # of what is left of the tolerance, for one step
GAIN = 4.0  # by which a correction must lower the bound; else only a shorter step can
# Seconds on a common machine: to factorise, of a multiplication and a number; to solve, of a number; of a digit of a
# flow; to take a channel's rate in a state exactly.
MULTIPLY, STORE, SOLVE, FLOW, ENTRY = 2e-9, 8e-8, 1e-8, 4e-9, 2e-5


@dataclass(frozen=True)
class Collocation(ListingMethod):
    """Radau collocation of high degree by sparse LU, for large and stiff chains, with a bound from the defect.

    On each step the solution is a polynomial, corrected until the integral of its defect |u' - u Q|, summed over the
    states, is small; these integrals add up to a bound on the summed absolute error at any time, and so relative to the
    total probability of 1, not to each single probability. The defect is found in fixed-point arithmetic, so that the
    bound is proven whatever was rounded before it. The errors of rate laws count in each jump that is expected; where
    one cannot be bounded it is an estimate.

    tolerance : largest bound on the summed error of the steps; reading a time off its polynomial adds about 1e-14
    max_states : networks with more reachable states are refused
    max_seconds : work roughly estimated to take longer is refused before it starts, or ended once it has

    Source: Hairer & Wanner (1996), doi:10.1007/978-3-642-05221-7, section IV.5 (Radau IIA); steps in
    proportion to time and a degree in proportion to digits as of Schoetzau & Schwab (2000),
    doi:10.1137/S0036142999352394; elimination in the order of Cuthill & McKee (1969), doi:10.1145/800195.805928. Cost:
    about log2(fastest rate * last time) steps, for any number of times, of s / 2 complex sparse LU factorisations each,
    s = 20 at a tolerance of 1e-12. A chain that turns in circles needs shorter steps. Choose it for stiff chains that
    are too large for `Dense`.

    >>> from kinetics import Collocation, Network, solve
    >>> stiff = Network.from_text('''A <-> B, 1e6, 1e6
    ... B -> C, 1e-3''')
    >>> late = solve(stiff, Collocation(), {"A": 1}, [2000.0])
    >>> late.mean().round(6).tolist(), late.error < 1e-11, late.is_bound
    ([[0.18394, 0.18394, 0.632121]], True, True)
    """

    name: ClassVar[str] = "collocation"
    least_tolerance: ClassVar[float | None] = 1e-15
    tried_up_to: ClassVar[int | None] = 1000

    tolerance: float = 1e-12
    max_states: int = 100_000
    max_seconds: float = 7200.0

    def probabilities(
        self, transitions: Transitions, start: Floats, grid: Floats, space: StateSpace | None = None
    ) -> ProbabilityTable:
        """Probabilities of all states."""
        n, listed = transitions.size, transitions.rates.size
        advice = "ask for fewer times, or start from smaller counts"
        check_memory(f"{n} states at {grid.size} times", 8.0 * (n * grid.size + 8.0 * listed), advice)
        plan = CollocationPlan.of(transitions.generator(), float(grid[-1]), self.tolerance, self.max_seconds)
        seconds = plan.seconds + ENTRY * listed
        if seconds > self.max_seconds:
            raise ValueError(
                f"{n} states would take about {plan.steps:.0f} steps until {grid[-1]:g}, up to {seconds:.3g} s; "
                f"{limit_in_words(self.max_seconds)}; raise it, ask for earlier times, "
                f"start from smaller counts, or sample with the direct method"
            )
        check_memory(f"the factors of {n} states", plan.n_bytes, "start from smaller counts")
        forecast(seconds, f"some {plan.steps:.0f} steps of collocation over {n} states")
        entries = best_entries(transitions, space)
        found, error = integrate(entries, start, grid, plan, self.tolerance, self.max_seconds)
        return ProbabilityTable(found, error, entries.is_certified)


class CollocationPlan(NamedTuple):
    """Settings and forecast cost of a collocation until the last time.

    order : (N,) states in the order of elimination, which keeps the rates in a narrow profile
    degree : s of the polynomials
    steps : expected
    step_seconds, correction_seconds : to factorise the equations of a step; to find a defect and correct it
    n_bytes : of factors and polynomials
    """

    order: Ints
    degree: int
    steps: float
    step_seconds: float
    correction_seconds: float
    n_bytes: float

    @property
    def seconds(self) -> float:
        """Forecast time of all steps, s."""
        return self.steps * (self.step_seconds + 3.0 * self.correction_seconds)

    @classmethod
    def of(cls, generator: csr_array, last: float, tolerance: float, max_seconds: float) -> CollocationPlan:
        """The plan for a generator (N, N), 1/tu.

        A step as long as the time before it, of a solution that is smooth but for time 0, has an error that falls as
        (3 + 2 sqrt(2))**-s: the degree is for that.
        """
        n = generator.shape[0]
        events = float(-generator.diagonal().min(initial=0.0)) * last
        if not (events <= MOST_EVENTS and last < LARGEST):
            raise ValueError(
                f"the chain is too stiff for collocation: its fastest rate times {last:g} is {events:.3g}, at most "
                f"{MOST_EVENTS:.0e}, until {LARGEST:.0e}; ask for earlier times, or use the method 'dense' if there "
                f"are few states"
            )
        # Reverse Cuthill-McKee keeps the factors within a narrow profile; its widths bound their cost.
        pattern: Any = abs(generator) + abs(generator.T)
        order = np.asarray(sparse.csgraph.reverse_cuthill_mckee(pattern.tocsr(), symmetric_mode=True), dtype=np.int64)
        place = np.empty(n, dtype=np.int64)
        place[order] = np.arange(n)
        entries, first = sparse.coo_array(pattern), np.arange(n)
        np.minimum.at(first, place[entries.row], place[entries.col])
        widths = (np.arange(n) - first).astype(float)
        # At worst, for one factorisation; then what it is, which may be far less.
        advice = "start from smaller counts, or sample with the direct method"
        check_memory(f"the factors of {n} states", 20.0 * (n + 2.0 * float(widths.sum())), advice)
        at_worst = MULTIPLY * float(widths @ widths)
        if at_worst > max_seconds:
            raise ValueError(
                f"{n} states, up to {widths.max():.0f} apart, may take {at_worst:.3g} s to factorise once; "
                f"max_seconds = {max_seconds:g}; raise it, {advice}"
            )
        forecast(at_worst, f"at most, to factorise {n} states once, from which the rest is forecast")
        lower, upper = fill(generator.T[order][:, order])
        multiplications, numbers = float(lower @ upper), float(lower.sum() + upper.sum())

        # (3 + 2 sqrt(2))**-s <= tolerance / 1000, s even since eigenvalues come in pairs.
        degree = 2 * ceil((3.0 - log10(tolerance)) / log10(3.0 + sqrt(8.0)) / 2.0)
        digits = (log2(max(events, 1.0)) - log2(tolerance) + 50.0) / 18.0
        factorising = degree / 2 * (MULTIPLY * multiplications + STORE * numbers)
        correcting = degree / 2 * SOLVE * numbers + FLOW * (degree + 1) * digits * (digits * pattern.nnz / 2 + 10.0 * n)
        n_bytes = 10.0 * degree * numbers + 8.0 * digits * (4.0 * (degree + 1) * n + 2.0 * pattern.nnz)
        return cls(order, degree, 8.0 + 1.2 * log2(max(events, 1.0)), factorising, correcting, n_bytes)


def integrate(
    entries: Entries, start: Floats, times: Floats, plan: CollocationPlan, tolerance: float, max_seconds: float
) -> tuple[Floats, float]:
    """start @ exp(Q t) (T, N) at `times` (T,), rising, and a proven bound on the summed absolute error at any of them.

    start : (N,) probabilities
    ValueError: the steps that it takes, counted as forecast, would take longer than max_seconds
    """
    n, result = start.size, np.tile(start, (times.size, 1))
    if not entries.rates.any() or times[-1] == 0.0:
        return result, 0.0
    place = np.empty(n, dtype=np.int64)
    place[plan.order] = np.arange(n)
    entries = entries._replace(rows=place[entries.rows], columns=place[entries.columns])
    steps = Steps(entries, start[plan.order], times[-1], plan, tolerance)
    exits, jumps = exit_rates(entries, n), 0.0
    error, done = steps.error, int(np.searchsorted(times, 0.0, side="right"))
    while done < times.size:
        if steps.seconds > max_seconds:
            raise ValueError(
                f"at {float(steps.begin):.3g} of {times[-1]:g} the steps of collocation, {float(steps.length):.3g} "
                f"tu, are far shorter than forecast, as in a chain that oscillates; max_seconds = "
                f"{max_seconds:g}; raise it, ask for earlier times, or sample with the direct method"
            )
        begin, length, polynomial = steps.go_on()
        coefficients = steps.chain.values(polynomial)
        # Expected jumps of the step, for the error that errors of the rates cause.
        sizes = np.abs(coefficients) @ integrals_of(coefficients.shape[1])
        jumps += ABOVE * float(length) / 2.0 * float(exits @ sizes)
        for row in range(done, times.size):
            time = Fraction(float(times[row]))  # exactly, as are all steps
            if time > steps.begin:
                break
            values, rounding = value_at(coefficients, 2 * (time - begin) / length - 1)
            # No probability is below zero: what is cut off there was error.
            result[row, plan.order] = np.maximum(values, 0.0)
            error, done = max(error, steps.error + rounding), row + 1
    return result, error + entries.wrong(jumps)


class Steps:
    """Steps from time 0 on, each a power of two, as long as the tolerance allows.

    begin, length : of the next step, tu
    error : bound on the summed error so far
    seconds : of work so far, as forecast
    """

    def __init__(self, entries: Entries, start: Floats, last: float, plan: CollocationPlan, tolerance: float) -> None:

        n, diagonal = start.size, np.arange(start.size)
        exits = exit_rates(entries, n)
        places = np.append(entries.columns, diagonal), np.append(entries.rows, diagonal)
        self._rates: Any = sparse.csc_array((np.append(entries.rates, -exits), places), shape=(n, n))
        self._plan, self._tolerance, self._last = plan, tolerance, last
        self.chain = FixedPointChain.of(entries, n, 2.0 * last, tolerance)
        first = Fraction(2) ** (2 - self.chain.scale)
        self._state = self.chain.digits(start)
        self.begin, self.length, self.seconds = Fraction(0), first, plan.step_seconds
        self.error = float(np.abs(self.chain.values(self._state) - start).sum())
        self._step, self._step_length = RadauStep(self._rates, float(first), plan.degree), first

    def go_on(self) -> tuple[Fraction, Fraction, Floats]:
        """Take a step: return its beginning, its length, and the digits of its polynomial."""
        while True:
            begin, length, allowed = self.begin, self.length, SHARE * (self._tolerance - self.error)
            polynomial, bound = self._polynomial(length, allowed)
            # Where a singularity on the line before the step would make polynomials fall as fast as the bound did.
            away = float(length) * (_opening(bound, self._plan.degree) - 1.0) / 2.0
            wanted = _opening(allowed, self._plan.degree) - 1.0
            if bound <= allowed:
                self.begin, self.error = begin + length, self.error + bound
                self._state = self.chain.end(polynomial)
                length_wanted = max(float(length) / 2.0, 2.0 * (away + float(length)) / wanted)
                # Beyond the last time there is nothing to find.
                self.length = _power_below(min(length_wanted, 2.0 * max(self._last - float(self.begin), float(length))))
                return begin, length, polynomial
            # Too long: try again with the length at which the bound is expected to fit, at least a sixteenth.
            self.length = min(length / 2, max(length / 16, _power_below(2.0 * away / wanted)))

    def _polynomial(self, length: Fraction, allowed: float) -> tuple[Floats, float]:
        """Digits of the polynomial that begins at the state, and the bound on its error, in as few corrections."""
        if self._step_length != length:
            self._step, self._step_length = RadauStep(self._rates, float(length), self._plan.degree), length
            self.seconds += self._plan.step_seconds
        planes, last = self.chain.constant(self._state, self._plan.degree), np.inf
        while True:
            self.seconds += self._plan.correction_seconds
            # Iterative refinement: the defect in fixed point, its correction in doubles, while that still gains.
            found = self.chain.defect(planes, self._state, length)
            if found.bound <= allowed or not found.bound * GAIN < last:
                return planes, found.bound
            planes, last = self.chain.plus(planes, self._step.correction(found.coefficients, found.jump)), found.bound


def _opening(bound: float, degree: int) -> float:
    """(r + 1 / r) / 2 where bound = r**-degree: how far beyond [-1, 1] a function is smooth, by Bernstein's ellipse."""
    radius: float = min(max(bound, 1e-300), 1.0) ** (-1.0 / degree)
    return (radius + 1.0 / radius) / 2.0


def _power_below(x: float) -> Fraction:
    return Fraction(2) ** floor(log2(x)) if x > 0.0 else Fraction(0)
