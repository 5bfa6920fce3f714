"""Maximum likelihood by exact gradients: estimates, profile-likelihood intervals, and what the data cannot tell.

All parameters are above 0 and are searched on their logarithms, by a quasi-Newton method (L-BFGS-B, Zhu et al. 1997,
doi:10.1145/279232.279236, in scipy), from several starts. The ends of an interval are where the largest log-likelihood
with that parameter held is less by half the 95 % quantile of chi-squared with one degree of freedom. They are found by
the Newton steps of Venzon & Moolgavkar (1988, doi:10.2307/2347496) with a Hessian that is updated on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinetics.support.arrays import Floats
from kinetics.support.cli.progress import stage
from kinetics.support.packages import optimize

Scored = Callable[[Floats], tuple[float, Floats]]  # logarithms of parameters (P,) -> log-likelihood and its gradient

FALL = 1.920729410347062  # of the log-likelihood at the ends of an interval: half of chi-squared's 95 % quantile
FARTHEST = np.log(1e8)  # from the estimate, in logarithms: beyond that the profile is called flat
HIGHEST = np.log(1e4)  # the same upwards, from the estimate or the first start: with larger rates chains are stiff
SCATTER = np.log(5.0)  # standard deviation of further starts around the first
AT_TOP = 1e-5  # of log-likelihood, that a Newton step from where the search ended may still gain
STEEP = 1e6  # rise of what is minimised where the likelihood is 0
SETTLED = 1e-9  # a gain of log-likelihood that ends the search
CLOSE = 1e-7  # of the log-likelihood at the ends of an interval, and between optima that are one
DIFFERENCE = 1e-4  # of a logarithm, for the Hessian by differences of exact gradients
NEWTON_STEPS, ROUNDS = 30, 60
LONGEST = 2.0  # that a logarithm moves before the search looks about anew: chains far from the data are stiff
OPTIONS: Any = {"ftol": 1e-13, "gtol": 1e-6, "maxcor": 20}


@dataclass(frozen=True, eq=False)
class ParameterFit:
    """Estimates of P parameters, with 95 % profile-likelihood intervals.

    value, low, high : (P,); an end that the data cannot tell is 0 or inf, and a value that they cannot tell is nan
    log_likelihood : at the estimates
    covariance : (P, P) of the logarithms, from the curvature there; None if that is not positive, or an estimate is at
        the end of its range
    gradient : (P,) by the logarithms, at the estimates
    evaluations : of the likelihood
    at : (P,) where the search ended; the estimates, but for those that the data cannot tell
    least, most : (P,) the range of each parameter
    notes : on flat profiles, other optima, and searches that did not converge
    """

    names: tuple[str, ...]
    value: Floats
    low: Floats
    high: Floats
    log_likelihood: float
    covariance: Floats | None
    gradient: Floats
    evaluations: int
    at: Floats
    least: Floats
    most: Floats
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Estimates and intervals by name, ready for JSON; null where the data cannot tell."""

        def number(x: float) -> float | None:
            return float(x) if np.isfinite(x) else None

        return {
            name: {"value": number(self.value[p]), "low": number(self.low[p]), "high": number(self.high[p])}
            for p, name in enumerate(self.names)
        }


def fit_parameters(
    scored: Scored,
    names: Sequence[str],
    start: Floats,
    *,
    least: Floats | None = None,
    most: Floats | None = None,
    starts: int = 3,
    seed: int = 0,
) -> ParameterFit:
    """The parameters of largest likelihood, from several starts, with their intervals.

    scored : the log-likelihood and its gradient by the logarithms of the parameters; ValueError where it is 0
    start : (P,) values to begin with, above 0; further starts are scattered around them by a factor of about 5
    least, most : (P,) smallest and largest values, such as 1 of a probability; None: there are none

    ValueError: the likelihood is 0 at all starts

    >>> import numpy as np
    >>> from calibration.estimating.likelihood_fit import fit_parameters
    >>> def waits(logs):  # 20 exponential waits of 3 tu each: n ln k - k sum
    ...     k = np.exp(logs[0])
    ...     return 20 * logs[0] - 60 * k, np.array([20 - 60 * k])
    >>> found = fit_parameters(waits, ["k"], np.array([1.0]))
    >>> found.value.round(6).tolist(), found.low.round(4).tolist(), found.high.round(4).tolist()
    ([0.333333], [0.2078], [0.5015])
    """
    smallest = np.zeros(len(names)) if least is None else np.asarray(least, dtype=float)
    largest = np.full(len(names), np.inf) if most is None else np.asarray(most, dtype=float)
    with np.errstate(divide="ignore"):
        search = _Search(
            scored, tuple(names), np.log(np.asarray(start, dtype=float)), np.log(smallest), np.log(largest)
        )
    return search.fit(starts, np.random.default_rng(seed))


class _Search:
    """A maximum and its surroundings."""

    def __init__(self, scored: Scored, names: tuple[str, ...], start: Floats, least: Floats, most: Floats) -> None:
        self._scored, self._names, self._start, self._least, self._most = scored, names, start, least, most
        self._evaluations = 0
        self._notes: list[str] = []

    def _at(self, logs: Floats) -> tuple[float, Floats]:
        """Log-likelihood and gradient; -inf where the likelihood is 0."""
        self._evaluations += 1
        if not (np.abs(logs) < 600.0).all() or (logs > self._most).any() or (logs < self._least).any():
            return -np.inf, np.zeros(logs.size)
        try:
            return self._scored(logs)
        except ValueError:
            if self._evaluations == 1:
                raise  # of the data, most likely: says what is wrong
            return -np.inf, np.zeros(logs.size)

    def fit(self, starts: int, rng: np.random.Generator) -> ParameterFit:
        """The best of all starts, and its intervals."""
        found, start = [], self._start
        for k in range(starts):
            begin = start if k == 0 else start + SCATTER * rng.standard_normal(start.size)
            begin = np.clip(begin, self._least, self._most)
            stage(f"fit from start {k + 1} of {starts}", 0.3 * k / starts)
            if np.isfinite(self._at(begin)[0]):
                found.append(self._maximum(begin))
        best, value = max(found, key=lambda each: each[1])
        others = sum(value - each[1] > max(CLOSE, 1e-9 * abs(value)) * 1e3 for each in found)
        if others:
            self._notes.append(f"{others} of {starts} starts ended at a lower maximum")
        gradient, hessian = self._at(best)[1], self._hessian(best)
        curvature, covariance = np.linalg.eigvalsh(-hessian), None
        if curvature[0] > 1e-9 * max(curvature[-1], 1e-9) and (self._least < best).all() and (best < self._most).all():
            covariance = np.asarray(np.linalg.inv(-hessian), dtype=np.float64)
        if covariance is not None and 0.5 * gradient @ covariance @ gradient > AT_TOP:
            self._notes.append("the search ended where the likelihood still rises; try other starts")
        low, high = np.zeros(start.size), np.full(start.size, np.inf)
        estimate = np.exp(best)
        for p in range(start.size):
            stage(f"interval of {self._names[p]}", 0.3 + 0.7 * p / start.size)
            ends = [self._end(p, side, best, value, hessian) for side in (-1, 1)]
            low[p], high[p] = (np.exp(end) if end is not None else (0.0, np.inf)[i] for i, end in enumerate(ends))
            if ends == [None, None]:
                estimate[p] = np.nan
                self._notes.append(f"the data cannot tell {self._names[p]}: the likelihood hardly depends on it")
            elif None in ends:
                said = "from below" if ends[0] is None else "from above"
                self._notes.append(f"the data do not bound {self._names[p]} {said}")
        return ParameterFit(
            self._names, estimate, low, high, value, covariance, gradient, self._evaluations,
            np.exp(best), np.exp(self._least), np.exp(self._most), tuple(self._notes),
        )  # fmt: skip

    def _maximum(self, begin: Floats, held: int | None = None) -> tuple[Floats, float]:
        """Where the likelihood is largest, with one parameter held; and that likelihood."""
        free = np.array([p for p in range(begin.size) if p != held], dtype=np.int64)
        if not free.size:
            return begin, self._at(begin)[0]

        known: list[Any] = [begin[free], 0.0]

        def downhill(part: Floats) -> tuple[float, Floats]:
            logs = begin.copy()
            logs[free] = part
            value, gradient = self._at(logs)
            if not np.isfinite(value):  # uphill from the last place where it was: searches take no infinity
                away = part - known[0]
                return known[1] + STEEP * float(away @ away), 2.0 * STEEP * away
            known[:] = [part.copy(), -value]
            return -value, -gradient[free]

        best, value = begin.copy(), -np.inf
        for _ in range(ROUNDS):
            near, far = np.maximum(best - LONGEST, self._least)[free], np.minimum(best + LONGEST, self._most)[free]
            box = list(zip(near.tolist(), far.tolist(), strict=True))
            found = optimize.minimize(downhill, best[free], jac=True, method="L-BFGS-B", bounds=box, options=OPTIONS)
            best[free], gained, value = found.x, -float(found.fun) - value, -float(found.fun)
            if gained < SETTLED or (np.abs(best - begin) > FARTHEST).any():
                break
        return best, value

    def _hessian(self, at: Floats) -> Floats:
        """Second derivatives (P, P), from differences of the gradient."""
        rows = []
        for p in range(at.size):
            step = np.zeros(at.size)
            step[p] = DIFFERENCE
            above = at if (at + step > self._most).any() else at + step
            below = at if (at - step < self._least).any() else at - step
            rows.append((self._at(above)[1] - self._at(below)[1]) / (above[p] - below[p]))
        table = np.array(rows)
        return np.asarray(0.5 * (table + table.T), dtype=np.float64)

    def _end(self, p: int, side: int, best: Floats, top: float, hessian: Floats) -> float | None:
        """Logarithm at which an interval ends; None if the profile never falls so far."""
        found = self._by_newton(p, side, best, top, hessian)
        return self._by_bisection(p, side, best, top) if found is None else found

    def _reach(self, p: int, side: int, best: Floats) -> float:
        """How far from the estimate an end is looked for, in logarithms."""
        return float(FARTHEST if side < 0 else HIGHEST + max(0.0, self._start[p] - best[p]))

    def _by_newton(self, p: int, side: int, best: Floats, top: float, hessian: Floats) -> float | None:
        """Steps of Venzon & Moolgavkar; None if they do not converge."""
        others = [q for q in range(best.size) if q != p]
        try:
            path = np.zeros(best.size)
            path[p] = 1.0
            if others:
                path[others] = -np.linalg.solve(hessian[np.ix_(others, others)], hessian[others, p])
            bend = -float(path @ hessian @ path)
            if not bend > 0.0:
                return None
            now = best + side * np.sqrt(2.0 * FALL / bend) * path
            before, slope, bent = best, np.zeros(best.size), hessian.copy()
            slope = self._at(best)[1]
            for _ in range(NEWTON_STEPS):
                if abs(now[p] - best[p]) > self._reach(p, side, best):
                    return None
                value, gradient = self._at(now)
                if not np.isfinite(value):
                    return None
                step, change = now - before, gradient - slope
                miss = change - bent @ step  # symmetric rank one update of the Hessian
                if abs(miss @ step) > 1e-8 * np.linalg.norm(miss) * np.linalg.norm(step):
                    bent = bent + np.outer(miss, miss) / (miss @ step)
                off = value - (top - FALL)
                scale = np.sqrt(np.abs(np.diag(hessian))) + 1e-12
                if abs(off) < CLOSE * 10 and (np.abs(gradient[others] / scale[others]) < 1e-4).all():
                    is_beyond = (now[p] - best[p]) * side > 0.0
                    return float(now[p]) if is_beyond else None
                system = np.concatenate([bent[others], gradient[None, :]])
                move = -np.linalg.solve(system, np.append(gradient[others], off))
                longest = 1.0 / max(1.0, float(np.abs(move).max()) / 1.5)
                before, slope, now = now, gradient, now + longest * move
        except np.linalg.LinAlgError:
            return None
        return None

    def _by_bisection(self, p: int, side: int, best: Floats, top: float) -> float | None:
        """The profile itself: its largest likelihoods at held values, bracketed by doubling, then halved."""
        inside, outside, near, length = best[p], None, best, 0.5
        reach = self._reach(p, side, best)

        def profile(at: float, begin: Floats) -> tuple[Floats, float]:
            held = begin.copy()
            held[p] = at
            return self._maximum(held, p)

        while outside is None:
            end = float((self._least if side < 0 else self._most)[p])
            at = float(np.clip(best[p] + side * min(length, reach), self._least[p], self._most[p]))
            there, value = profile(at, near)
            if value < top - FALL:
                outside = at
            elif at == end:
                return end
            elif length >= reach:
                return None
            else:
                inside, near, length = at, there, 2.0 * length
        for _ in range(ROUNDS):
            middle = 0.5 * (inside + outside)
            there, value = profile(middle, near)
            if value < top - FALL:
                outside = middle
            else:
                inside, near = middle, there
            if abs(outside - inside) < 1e-6:
                break
        return float(0.5 * (inside + outside))
