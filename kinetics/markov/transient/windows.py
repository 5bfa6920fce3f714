"""Windows of time in which a chain on packed states is followed: its set of states grows with the probability.

All that is dropped or leaves the set is lost, never moved: every probability found is a lower bound but for rounding,
and what is missing from their sum bounds the summed error (Munsky & Khammash 2006, doi:10.1063/1.2145882).
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from math import log2
from typing import NamedTuple

import numpy as np

from kinetics.markov.transient.growth import CAUTION, SetGrowth, likeliest, moved
from kinetics.markov.transient.packed import GOAL, LIVE, Judge, PackedChain, Packing, Rows
from kinetics.markov.transient.poisson import ROUNDOFF, poisson_tails, poisson_window, window_error
from kinetics.markov.transient.search import TooManyStatesError
from kinetics.markov.transient.transitions import RATE_ERROR
from kinetics.markov.transient.uniformisation import MAX_STEPS, summed_rounding
from kinetics.native import packed
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints
from kinetics.support.cli.progress import limit_in_words, stage
from kinetics.support.memory import check_memory

ADVICE = "Ask for earlier times, a larger tolerance or smaller counts, sample instead, or raise max_states"
FIRST_EVENTS, MOST_EVENTS = 24.0, 80.0  # expected steps of a window
MOST_ASKED = 16  # times that one window serves
POISSON_SHARE = 0.02  # of the tolerance, for the Poisson windows
PLANNED_SHARE = 0.36  # of the tolerance, for what the set does not grow to
KEPT_SHARE = 0.9  # of the tolerance, for what is lost; the rest is for results that drop unlikely states
ROOM = 1.02  # of the uniformisation rate above the largest exit rate, for states that come later
TRIAL = 0.02  # of the steps or the time allowed, done before the rest is forecast
NOISE = 1e-15  # by which a sum of probabilities may miss


class Limits(NamedTuple):
    """Largest probability lost, states and CPU time, s."""

    tolerance: float
    max_states: int
    max_seconds: float


class Found(NamedTuple):
    """At a time asked for: keys (n,) of likely states, their probabilities (n,), and those of goals and failures."""

    keys: Ints
    mass: Floats
    goal: float
    failed: float


class WindowsCost(NamedTuple):
    """Steps, steps times states, the largest set of states kept after a window and at any time, and CPU time, s."""

    steps: float
    work: float
    kept: int
    most: int
    seconds: float


class Windows:
    """A chain from one state, followed window by window to the last of the times asked for.

    judge : verdicts on states, in which nothing more happens unless they are live
    found : what is known at the times `grid` (T,) passed so far
    """

    def __init__(
        self, network: Network, start: Ints, grid: Floats, limits: Limits, pool: ThreadPoolExecutor,
        judge: Judge | None = None, caution: float = CAUTION,
    ) -> None:  # fmt: skip
        self.network, self.grid, self.limits, self.pool = network, grid, limits, pool
        self.packing = Packing.of(network, start)
        self.chain = PackedChain(self.packing, judge, pool)
        self.rows = self.chain.rows(self.packing.keys(start[None, :]))
        self.mass, self.time = np.ones(1), 0.0
        self.goal = self.failed = 0.0
        self.rounding = self.drift = 0.0
        self.steps, self.work, self.kept, self.most, self.checked = 0.0, 0.0, 1, 1, 0
        self.length, self.room = FIRST_EVENTS, ROOM
        planned = PLANNED_SHARE * limits.tolerance / float(grid[-1] or 1.0)
        self.growth = SetGrowth(self.chain, planned, caution, self.check_size)
        self.began = time.process_time()
        self.found: list[Found] = []
        self._bank()
        if grid[0] == 0.0:
            self.found.append(self._trimmed(self.rows, self.mass))

    @property
    def is_over(self) -> bool:
        """Whether all times asked for have been passed."""
        return len(self.found) == self.grid.size

    @property
    def cost(self) -> WindowsCost:
        """What it has taken so far."""
        return WindowsCost(self.steps, self.work, self.kept, self.most, time.process_time() - self.began)

    @property
    def held(self) -> float:
        """All probability that is not lost."""
        return float(self.mass.sum()) + self.goal + self.failed

    def error(self, found: Found) -> float:
        """Bound on the summed error at a time."""
        lost = 1.0 - (float(found.mass.sum()) + found.goal + found.failed)
        return max(lost, 0.0) + self.drift + self.rounding + ROUNDOFF * (2 * len(self.found) + log2(self.most) + 24)

    def advance(self) -> None:
        """Go on by one window; with a set that grows more, or more room for fast states, where too much is lost."""
        if not self.chain.n_channels or not self.rows.exits.any():
            self._stay()
            return
        allowed = KEPT_SHARE * self.limits.tolerance * self._share(min(self._planned_end(), float(self.grid[-1])))
        held = self.held
        for trial in range(24):
            rows, sums, times, error = self._window()
            lost, most = held - float(sums[-1].sum()) - self.goal - self.failed, max(allowed - (1.0 - held), 0.0) / 2
            if lost <= most + NOISE:
                self.length = self.length if trial else min(1.5 * self.length, MOST_EVENTS)
                if lost < 0.1 * most:
                    self.growth.dare()
                break
            self.growth.beware()
            self.room *= 1.1
            self.length = max(self.length / 1.5, FIRST_EVENTS / 2)
        else:
            raise TooManyStatesError.of(self.too_many(), ADVICE)
        self.rounding += error
        for row, at in zip(sums, times, strict=True):
            if len(self.found) < self.grid.size and self.grid[len(self.found)] == at:
                self.found.append(self._trimmed(rows, row))
        self.time, self.rows, self.mass = float(times[-1]), rows, sums[-1]
        self._bank()
        self._drop(max(allowed - (1.0 - self.held), 0.0) / 2)
        self.kept = max(self.kept, self.mass.size)
        self._rest()
        self.room = max(ROOM, self.room / 1.02)
        share = self.time / self.grid[-1]
        stage(f"matrix-free: {self.time:.4g} of {self.grid[-1]:g} on {self.mass.size} states", share)

    def _share(self, end: float) -> float:
        """Of all that may be lost, as much as may be lost until a time; more of it early, when sets are small."""
        return 0.2 + 0.8 * end / float(self.grid[-1])

    def _planned_end(self) -> float:
        return self.time + self.length / max(float(self.rows.exits.max()), 1e-300)

    def _window(self) -> tuple[Rows, Floats, Floats, float]:
        """States, probabilities (T, N) at times (T,), and the bound on their rounding, as nothing has changed yet."""
        _, leads = self.chain.steps(self.rows, 1.0)
        fastest = float(self.rows.exits.max())
        span = self.growth.stride / fastest
        rows, vector = self.growth.grown(self.rows, self.mass, np.inf, span, 1.0, leads)
        rate = self.room * float(rows.exits.max())
        last = float(self.grid[-1])
        end = min(self.time + self.length / rate, last)
        if end + 0.1 * self.length / rate > last:
            end = last
        self._check_work(rate)
        asked = self.grid[(self.grid > self.time) & (self.grid < end)]
        if asked.size > MOST_ASKED:
            asked, end = asked[:MOST_ASKED], float(asked[MOST_ASKED])
        times = np.append(asked, end)
        tolerance = max(POISSON_SHARE * self.limits.tolerance * (end - self.time) / last, 1e-300)
        means = [rate * float(at - self.time) for at in times]
        windows = [poisson_window(mean, tolerance / 2) for mean in means]
        n_steps = max(first + weights.size for first, weights in windows)
        table = np.zeros((times.size, n_steps))
        for row, (first, weights) in zip(table, windows, strict=True):
            row[first : first + weights.size] = weights
        tails = np.append(poisson_tails(*windows[-1], tolerance), np.zeros(1))[:n_steps]
        rows, sums, jumps = self._stepped(rows, vector, rate, table, np.ascontiguousarray(tails))
        errors = [
            window_error(mean, first, weights, tolerance / 2) + ROUNDOFF * (weights.size + 2)
            for mean, (first, weights) in zip(means, windows, strict=True)
        ]
        error = max(errors) + summed_rounding(n_steps, jumps, 2 * self.chain.n_channels, self.roundings)
        return rows, sums, times, error

    @property
    def roundings(self) -> float:
        """The error of the rates that bounds use: the proven one, or that of mass action for an estimate."""
        return self.chain.rate_error if np.isfinite(self.chain.rate_error) else RATE_ERROR

    def _stepped(
        self, rows: Rows, vector: Floats, rate: float, weights: Floats, tails: Floats
    ) -> tuple[Rows, Floats, float]:
        """Sums (T, N) of weights (T, B) times the vectors of B steps; the set grows on the way. Expected events."""
        n_steps, jumps, done = tails.size, 0.0, 0
        sums = np.zeros((len(weights), vector.size))
        steps, leads = self.chain.steps(rows, rate)
        while done < n_steps:
            count = min(self.growth.stride, n_steps - done)
            if done:
                grown, vector = self.growth.grown(rows, vector, rate, count / rate, float(tails[done]), leads)
                if grown is not rows:
                    places = np.searchsorted(grown.keys, rows.keys)
                    sums, rows = moved(sums, places, grown.keys.size), grown
                    steps, leads = self.chain.steps(rows, rate)
            n = rows.keys.size
            now, events = np.append(vector, 0.0), np.zeros(-(-n // packed.ROWS))
            now, _ = steps.run(weights, tails, done, count, now, np.zeros(n + 1), sums, events, self.pool)
            vector, done, jumps = now[:n], done + count, jumps + float(events.sum())
            self.work += float(count) * n
        self.steps += n_steps
        return rows, sums, jumps

    def _trimmed(self, rows: Rows, mass: Floats) -> Found:
        """What is known at a time, without states that together hold no more than a share of the tolerance."""
        goal = self.goal + float(mass[rows.verdicts == GOAL].sum())
        failed = self.failed + float(mass[rows.verdicts > GOAL].sum())
        kept = (rows.verdicts == LIVE) & (mass > 0.0)
        if mass.size > 1:
            kept &= likeliest(mass, (1.0 - KEPT_SHARE) / 2 * self.limits.tolerance)
        return Found(rows.keys[kept], mass[kept], goal, failed)

    def _bank(self) -> None:
        """Count what has reached goals and failures, which nothing leaves, and drop these states."""
        live = self.rows.verdicts == LIVE
        if not live.all():
            is_goal = self.rows.verdicts == GOAL
            self.goal += float(self.mass[is_goal].sum())
            self.failed += float(self.mass[~is_goal & ~live].sum())
            self.rows, self.mass = self.rows.picked(live), self.mass[live]

    def _drop(self, allowed: float) -> None:
        """Drop states that hold little probability, together no more than is allowed."""
        kept = likeliest(self.mass, allowed)
        if not kept.all():
            self.rows, self.mass = self.rows.picked(kept), self.mass[kept]
        self.mass = np.ascontiguousarray(self.mass)

    def _stay(self) -> None:
        """Nothing happens any more: all times to come are as now."""
        self.found += [self._trimmed(self.rows, self.mass)] * (self.grid.size - len(self.found))

    def _rest(self) -> None:
        """Keep the distribution as it is until the last time, if its drift until then is small enough.

        d/dt of p(t) - p is (p(t) - p) Q + p Q, and exp(Q t) enlarges no difference: p(t) departs from p by at most t
        times the sum of |p Q|, all flow out of the set included.
        """
        left, rate = float(self.grid[-1]) - self.time, float(self.rows.exits.max(initial=0.0))
        if left * rate < 2.0 * self.length or self.is_over:
            return
        n, one = self.mass.size, np.ones(1)
        now, events = np.append(self.mass, 0.0), np.zeros(-(-n // packed.ROWS))
        steps, _ = self.chain.steps(self.rows, rate)
        after, _ = steps.run(np.zeros((1, 1)), one, 0, 1, now, np.zeros(n + 1), np.zeros((1, n)), events, self.pool)
        out = max(float(self.mass.sum()) - float(after.sum()), 0.0)
        drift = 1.01 * left * rate * (float(np.abs(after[:n] - self.mass).sum()) + out + 4.0 * ROUNDOFF)
        rounding = summed_rounding(0, left * rate * float(events.sum()), 2 * self.chain.n_channels, self.roundings)
        allowed = 0.5 * max(KEPT_SHARE * self.limits.tolerance - (1.0 - self.held), 0.0)
        if drift + rounding <= allowed:
            self.drift, self.rounding = self.drift + drift, self.rounding + rounding
            self._stay()

    def check_size(self, n: int) -> None:
        """Refuse a set of n states that are too many, or take too much memory."""
        self.most = max(self.most, n)
        if n > self.limits.max_states:
            raise TooManyStatesError.of(self.too_many(), ADVICE)
        if n > 1.2 * self.checked:
            self.checked = n
            needed = state_bytes(self.chain.n_channels, len(self.packing.law_channels)) * n
            check_memory(f"{n} states at once", needed, "ask for earlier times, a larger tolerance or smaller counts")

    def _check_work(self, rate: float) -> None:
        """Refuse what is too stiff, or forecast to take too long at the pace so far."""
        left, limit = float(self.grid[-1]) - self.time, self.limits.max_seconds
        total, seconds = self.steps + rate * left, time.process_time() - self.began
        cost = seconds * total / max(self.steps, 1.0)
        is_stiff = self.steps > TRIAL * MAX_STEPS and total > MAX_STEPS
        is_long = self.steps > 0 and seconds > TRIAL * limit and cost > limit
        if is_stiff or is_long or self.time + 1.0 / rate == self.time:
            raise ValueError(
                f"the chain is too stiff or too large for the matrix-free method: {self.time:.4g} of {self.grid[-1]:g} "
                f"took {self.steps:.3g} steps on up to {self.most} states, and all would take {total:.3g} or more, "
                f"about {cost:.3g} s; at most {MAX_STEPS} steps and {limit_in_words(limit)}, which may be raised; ask "
                f"for earlier times, lower the fastest rates, use the method 'transient' if there are few states, or "
                f"sample"
            )

    def too_many(self) -> str:
        """A sentence on how far it came."""
        return (
            f"over {self.limits.max_states} states matter: {self.mass.size} held all but {self.limits.tolerance:.0e} "
            f"of the probability at {self.time:.4g} of {self.grid[-1]:g}, and more were needed"
        )


def state_bytes(n_channels: int, n_laws: int) -> float:
    """Bytes of a state in a window: sources, key, verdict, exits, two vectors, sums, and copies as the set grows."""
    return 4.0 * n_channels + 8.0 * (2 * n_laws + 12) + 16.0
