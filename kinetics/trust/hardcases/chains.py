"""Hard cases of chains from outside: generators, starts and labels that no network gives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import comb, expm1, factorial
from typing import Any

import numpy as np

from kinetics.markov import Chain, Reward, chain_path, chain_path_to
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats
from kinetics.support.packages import sparse
from kinetics.trust.hardcases.case import Attempt, Case, attempt, refusal, relative

DIGITS = 1e-13


def within(answer: Answer, exact: float | Fraction) -> float:
    """Relative error of an answer; infinite if the right one lies outside its limits, or these are not proven."""
    near = Fraction(exact) * Fraction(1, 2**52)  # as far as the right answer may itself be rounded
    holds = Fraction(answer.low) - near <= Fraction(exact) <= Fraction(answer.high) + near
    return relative(answer.value, float(exact)) if holds and answer.is_bound else np.inf


def _line(ups: Floats, downs: Floats | None = None) -> Floats:
    """Rates (n + 1, n + 1) of n steps up and, if given, down."""
    return np.diag(ups, 1) + (0.0 if downs is None else np.diag(downs, -1))


def _blocks() -> Iterator[Attempt]:
    # With flows that are equal both ways between all pairs, weights rest whatever the rates.
    blocks, size = 4, 6
    n = blocks * size
    block = np.arange(n) // size
    weights = 10.0 ** (np.arange(n) * 7 % n / 8.0 - 1.5)  # over three decades
    flows = np.where(block[:, None] == block, 1.0, 0.0) + np.where(abs(block[:, None] - block) == 1, 1e-12, 0.0)
    np.fill_diagonal(flows, 0.0)
    shares = weights / weights.sum()
    last = block == blocks - 1
    chain = Chain(flows / weights[:, None] * 30.0, 0, {"last": last})
    yield attempt("stationary", lambda: relative(chain.stationary().probabilities, shares), DIGITS)
    yield attempt("steady state", lambda: within(chain.steady_state("last"), shares[last].sum()), DIGITS)


def _remote() -> Iterator[Attempt]:
    # 47 steps at 1e-3 within 1 tu: so many or more of a Poisson number. From 40 to 46 as well, each with its chance.
    n, mean = 47, Fraction(1e-3)
    first = [sum(mean**k / factorial(k) for k in range(m, m + 12)) for m in range(n + 1)]
    grown = sum(mean**k / factorial(k) for k in range(12))  # e to the mean
    rates = _line(np.full(n, 1e-3))
    end = np.arange(n + 1) == n
    yield attempt(
        f"until, chance {float(first[n] / grown):.0e}",
        lambda: within(Chain(rates, 0).until(end, by=1.0), first[n] / grown),
        1e-12,
    )
    start = np.where(np.arange(n + 1) < 2, 0.5, 0.0)
    spread = (first[n] + first[n - 1]) / 2 / grown
    yield attempt(
        f"until, from two states, {float(spread):.0e}",
        lambda: within(Chain(rates, start).until(end, by=1.0), spread),
        1e-12,
    )
    # And ever: against a drift of 1e-5, before falling back to the first state.
    steps, ratio = 40, Fraction(10**5)
    ruin = 1 / sum(ratio**k for k in range(steps))
    walk = Chain(_line(np.full(steps, 1.0), np.full(steps, 1e5)), 1)
    ends = np.arange(steps + 1)
    yield attempt(f"until, ever, {float(ruin):.0e}", lambda: within(walk.until(ends == steps, ends > 0), ruin), DIGITS)
    yield attempt(
        f"committor, {float(ruin):.0e}",
        lambda: relative(walk.committor({"low": ends == 0, "high": ends == steps}).probabilities[1], float(ruin)),
        DIGITS,
    )


def _classes() -> Iterator[Attempt]:
    # A fair walk between two ends: one state, and a pair that goes on for ever. It begins anywhere between them.
    n = 30
    rates = np.zeros((n + 2, n + 2))
    rates[: n + 1, : n + 1] = _line(np.append(0.0, np.full(n - 1, 2.0)), np.append(np.full(n - 1, 2.0), 0.0))
    rates[n, n + 1], rates[n + 1, n] = 3.0, 1.0
    weights = [Fraction(k) for k in range(1, n)]
    total = sum(weights)
    start = np.array([0.0, *(float(w / total) for w in weights), 0.0, 0.0])
    pair = sum((w / total * w / n for w in weights), Fraction(0))
    places = np.arange(n + 2)
    chain = Chain(rates, start, {"one": places == 0, "pair": places >= n, "second": places == n + 1})
    yield attempt("steady state, one state", lambda: within(chain.steady_state("one"), 1 - pair), DIGITS)
    yield attempt("steady state, within the pair", lambda: within(chain.steady_state("second"), pair * 3 / 4), DIGITS)
    yield attempt("until, ever", lambda: within(chain.until("pair"), pair), DIGITS)
    ends = partial(chain.committor, {"one": "one", "pair": "pair"})
    yield attempt("committor", lambda: relative(ends().probabilities, [float(1 - pair), float(pair)]), DIGITS)
    yield attempt("passage", lambda: relative(chain.passage("pair").probability, float(pair)), DIGITS)
    yield refusal(
        "reward until one of them", partial(replace(chain, rewards={"r": places}).reward, until="pair"), "finite"
    )


def _nothing_moves() -> Iterator[Attempt]:
    for n in (1, 3):
        start = np.arange(1.0, n + 1.0) / (n * (n + 1) / 2)
        chain = Chain(np.zeros((n, n)), start, {"last": np.arange(n) == n - 1}, {"r": np.full(n, 2.0)})
        kind = "one state" if n == 1 else "no rates"
        last = float(start[-1])
        yield attempt(f"transient, {kind}", lambda c=chain, s=start: relative(c.transient([7.0]).probabilities, [s]), 0)
        yield attempt(f"stationary, {kind}", lambda c=chain, s=start: relative(c.stationary().probabilities, s), 0)
        for ever, by in (("ever", None), ("by 7", 7.0)):
            yield attempt(f"until {ever}, {kind}", lambda c=chain, t=by, p=last: within(c.until("last", by=t), p), 0)
            yield attempt(f"always {ever}, {kind}", lambda c=chain, t=by, p=last: within(c.always("last", t), p), 0)
        yield attempt(f"reward up to 7, {kind}", lambda c=chain: within(c.reward("r", up_to=7.0), 14.0), DIGITS)
        yield attempt(f"path, {kind}", lambda c=chain: float(chain_path(c, 7.0, seed=1).states.size - 1), 0)


def _nowhere() -> Iterator[Attempt]:
    chain = Chain(_line(np.ones(4), np.ones(4)), 0, {"nowhere": np.zeros(5, bool)}, {"r": np.ones(5)})
    yield attempt("until", lambda: within(chain.until("nowhere"), 0), 0)
    yield attempt("until by 7", lambda: within(chain.until("nowhere", by=7.0), 0), 0)
    yield attempt("steady state", lambda: within(chain.steady_state("nowhere"), 0), 0)
    yield attempt("passage", lambda: chain.passage("nowhere").probability, 0)
    yield refusal("reward until", partial(chain.reward, "r", until="nowhere"), "finite")
    yield refusal("path to", partial(chain_path_to, chain, "nowhere"), "never reached")


def _impulses() -> Iterator[Attempt]:
    # Each way up earns 1: a t less what the start does. Up at 1e-6, down at 1e3.
    up, down, t = 1e-6, 1e3, 10.0
    exits = Fraction(up) + Fraction(down)
    settled = Fraction(up) * Fraction(down) / exits
    ways = _line(np.array([up]), np.array([down]))
    each = Chain(ways, 0, {"up": [False, True]}, {"ups": Reward([0.0, 0.0], _line(np.ones(1)))})
    counted = settled * Fraction(t) + (Fraction(up) / exits) ** 2 * Fraction(-expm1(-float(exits) * t))
    yield attempt("up to 10", lambda: within(each.reward("ups", up_to=t), counted), 1e-11)
    yield attempt("steady state", lambda: within(each.reward("ups", stationary=True), settled), DIGITS)
    yield attempt("until", lambda: within(each.reward("ups", until="up"), 1), DIGITS)
    yield refusal("at one time", partial(each.reward, "ups", at=t), "impulses")


def machines(n: int, fail: float, repair: float, time: float) -> tuple[Floats, Floats]:
    """Rates (n + 1, n + 1) between numbers of failed machines, all independent, and their distribution from none."""
    numbers = np.arange(n + 1.0)
    p = fail / (fail + repair) * -expm1(-(fail + repair) * time)
    law = np.array([comb(n, k) * p**k * (1.0 - p) ** (n - k) for k in range(n + 1)])
    return _line(fail * (n - numbers[:-1]), repair * numbers[1:]), law


def _stiff() -> Iterator[Attempt]:

    # Two groups of machines that know nothing of each other; 3e-2 down to 3e-8, until 3.6e8.
    time = 3.6e8
    (quick, first), (slow, second) = machines(30, 3e-4, 3e-2, time), machines(20, 3e-8, 1e-7, time)
    generator: Any = sparse.kron(sparse.csr_array(quick), sparse.eye_array(21)) + sparse.kron(
        sparse.eye_array(31), sparse.csr_array(slow)
    )
    law = np.outer(first, second).ravel()
    n_slow = np.tile(np.arange(21), 31)
    chain = Chain(generator, 0, {"half": n_slow >= 10})
    soon = partial(chain.until, "half", by=1e-3)
    yield attempt("until by 1e-3", lambda: within(soon(), _soon(20, 10, 3e-8, 1e-7, 1e-3)), 1e-10)
    share = Fraction(3e-8) / (Fraction(3e-8) + Fraction(1e-7))
    half = sum(comb(20, k) * share**k * (1 - share) ** (20 - k) for k in range(10, 21))
    yield attempt("steady state", lambda: within(chain.steady_state("half"), half), 1e-12)
    late = partial(chain.transient, [time])

    def off() -> float:
        """Summed over the states, over its own bound and the rounding of the products."""
        found = late()
        return float(abs(found.probabilities[0] - law).sum() / (found.error + 1e-13))

    yield attempt("exact, by collocation, over its bound", off, 1.0)


def _soon(n: int, k: int, fail: float, repair: float, time: float) -> float:
    """Chance that k of n machines have failed at once by a time so early that repairs are felt in first order alone."""
    # k failures in a row: product of rates times t**k / k!, less the exits on the way, each felt for a (k + 1)th of t.
    chance, exits = Fraction(1), Fraction(0)
    for failed in range(k):
        chance *= Fraction(fail) * (n - failed) * Fraction(time) / (failed + 1)
        exits += Fraction(fail) * (n - failed) + Fraction(repair) * failed
    return float(chance * (1 - exits * Fraction(time) / (k + 1)))


CHAINS = (
    Case("chain in blocks", "24 states, rates 1e-12 to 1e3: relative error", "equal flows in both directions", _blocks),
    Case("remote target", "down to 1e-201: relative error, within the bounds", "Poisson tail, rational sums", _remote),
    Case("classes from outside", "a state and a pair, from all between: relative error", "fair walk", _classes),
    Case("nothing moves", "one state, or three without rates: relative error", "the start", _nothing_moves),
    Case("nowhere", "a label that no state has: 0, or a refusal", "0", _nowhere),
    Case(
        "impulses", "rates of 1e-6 upwards, 1e3 downwards: relative error, within the bounds", "closed form", _impulses
    ),
    Case("stiff from outside", "651 states, rates 3e-8 to 1, until 3.6e8", "products of binomials", _stiff),
)
