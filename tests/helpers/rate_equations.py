"""The rate equations of a network that was read: its propensities at real counts, integrated by scipy, with its events.

It shares the compiled formulas with the samplers, and nothing of how they run them.
"""

import heapq
import math
from itertools import count

import numpy as np
from scipy.integrate import solve_ivp

from kinetics.network.laws.program import evaluate, steps_of

TRIED = 64  # moments of a stretch at which conditions are looked at


class NegativeRateError(ValueError):
    """A propensity below 0, at which a run is refused."""


class RateEquations:
    """dy/dt = stoichiometry · propensities of a network, and its events."""

    def __init__(self, network, rate=1.0):
        self.network = network
        self.places = {name: s for s, name in enumerate(network.species)}
        self.change = network.stoichiometry.astype(float)
        self.rates = rate * network.known_rates * network.ways
        self.laws = {
            r: self._steps(network.laws[name]) for r, name in enumerate(network.channels) if name in network.laws
        }
        self.events = sorted(network.events, key=lambda event: -event.priority)
        self.conditions = [self._steps(event.condition) for event in self.events]

    def _steps(self, formula):
        return steps_of(formula, self.places)

    def value(self, formula, y, t):
        """An expression at real counts."""
        return float(evaluate(self._steps(formula), y, t))

    def propensities(self, y, t):
        """(R,) k N h, polynomials in real counts where they are mass action."""
        made = self.rates.copy()
        for r in range(made.size):
            if r in self.laws:
                made[r] *= evaluate(self.laws[r], y, t)
                continue
            for s, copies in zip(*self.network.sparse_reactants.row(r), strict=True):
                made[r] *= math.prod(y[s] - i for i in range(copies))
                made[r] /= math.factorial(copies) if self.network.combinations == "distinct" else 1
        return made

    def solution(self, initial, times):
        """Real counts (T, S) at the times; a NegativeRateError where a law is below 0 on the way."""
        y, t, waiting, order = np.array(initial, dtype=float), 0.0, [], count()
        is_true = [event.was_true for event in self.events]
        y = self._settle(y, t, is_true, waiting, order)
        made = np.empty((len(times), y.size))
        for i, until in enumerate(times):
            while t < until or (waiting and waiting[0][0] <= t):
                end = min(until, waiting[0][0]) if waiting else until
                y, t = self._flow(y, t, end, is_true)
                y = self._settle(y, t, is_true, waiting, order)
            made[i] = y
        return made

    def _flow(self, y, t, end, is_true):
        """The counts where the next condition turns, or at the end."""
        if end <= t:
            return y, t
        found = solve_ivp(
            lambda now, x: self.change.T @ self.propensities(x, now),
            (t, end), y, method="LSODA", rtol=1e-10, atol=1e-13 * max(1.0, y.max(initial=0)), dense_output=True,
        )  # fmt: skip
        assert found.success, found.message
        rates = self.propensities(found.y[:, -1], end)
        if rates.min(initial=0) < -1e-7 * max(1e-6, np.abs(rates).max(initial=0)):
            raise NegativeRateError(f"a propensity of {rates.min():g} at t = {end:g}")
        before = t
        for after in np.linspace(t, end, TRIED)[1:] if self.events else ():
            now = after
            if self._truth(found.sol(now), now) != is_true:
                while now - before > 1e-13 * max(1.0, now):
                    middle = 0.5 * (before + now)
                    before, now = (
                        (middle, now) if self._truth(found.sol(middle), middle) == is_true else (before, middle)
                    )
                return found.sol(now), now
            before = now
        return found.y[:, -1], end

    def _truth(self, y, t):
        return [bool(evaluate(steps, y, t)) for steps in self.conditions]

    def _settle(self, y, t, is_true, waiting, order):
        """Counts after all events of a moment."""
        for _ in range(1000):
            for e, now in enumerate(self._truth(y, t)):
                event = self.events[e]
                if now and not is_true[e]:
                    new = self._new(event, y, t) if event.from_trigger else None
                    heapq.heappush(waiting, (t + self.value(event.waits, y, t), e, next(order), new))
                elif not (now or event.persistent):
                    waiting[:] = [each for each in waiting if each[1] != e]
                    heapq.heapify(waiting)
                is_true[e] = now
            due = [each for each in waiting if each[0] <= t + 1e-12 * max(1.0, t)]
            if not due:
                return y
            first = min(due, key=lambda each: each[1:3])
            waiting.remove(first)
            heapq.heapify(waiting)
            new = self._new(self.events[first[1]], y, t) if first[3] is None else first[3]
            y = y.copy()
            for species, value in new.items():
                y[self.places[species]] = value
        raise AssertionError("events without end")

    def _new(self, event, y, t):
        return {name: self.value(formula, y, t) for name, formula in event.new_counts.items()}
