"""Hard cases of rate laws whose digits cancel: a bound must hold, or not be called one."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal, localcontext
from functools import partial
from math import prod

import numpy as np

from kinetics.markov.passage.moments import passage_to
from kinetics.markov.transient import Distribution, reachable
from kinetics.network import Network
from kinetics.support.arrays import Floats
from kinetics.trust.hardcases.case import Attempt, Case, attempt, relative, solved

COPIES, TIME = 20, 0.5
SCALE = 10**9


def _rates() -> list[Decimal]:
    """2 SCALE (1 - exp(-n / SCALE)) for n = 0, 1, ..., to 80 digits."""
    return [2 * SCALE * (1 - (-Decimal(n) / SCALE).exp()) for n in range(COPIES + 1)]


def _exact() -> tuple[Floats, float]:
    """Probabilities (COPIES + 1,) of the counts at TIME, and the mean time until none is left."""
    with localcontext() as context:
        context.prec = 80
        rates, time = _rates(), Decimal(TIME)
        found = []
        for n in range(COPIES + 1):
            passed = prod(rates[n + 1 :], start=Decimal(1))
            terms = [
                (-rate * time).exp() / prod((other - rate for other in rates[n:] if other != rate), start=Decimal(1))
                for rate in rates[n:]
            ]
            found.append(float(passed * sum(terms)))
        return np.array(found), float(sum(1 / rate for rate in rates[1:]))


def _cancellation() -> Iterator[Attempt]:
    few, none = (
        Network.from_reactions({"death": ({"X": 1}, {})}, [law])
        for law in (f"{2 * SCALE} * (1 - exp(-X / {SCALE}))", "1e17 * (1 - exp(-1e-17 * X))")
    )
    exact, mean = _exact()
    yield from solved(few, [COPIES], [TIME], lambda found: _beyond(found, exact), 1.0, ", half of the digits")
    yield from solved(none, [COPIES], [TIME], lambda found: float(found.is_bound), 0.0, ", none")

    space = reachable(few, [COPIES])
    dead = partial(passage_to, space.transitions(), np.eye(1, COPIES + 1)[0], space.states[:, 0] == 0, "none")
    yield attempt("passage, half of the digits", lambda: relative(dead().mean, mean) / dead().error, 1.0)


def _beyond(solution: Distribution, exact: Floats) -> float:
    """Summed error over the one that is stated; infinite if this is no bound."""
    off = float(np.abs(solution.marginal("X")[0] - exact).sum())
    return off / solution.error if solution.is_bound else float("inf")


CANCELLATION = (
    Case(
        "cancellation",
        "deaths by a law that loses digits: summed error over its bound; if none are left, there is no bound",
        "closed form, 80 digits",
        _cancellation,
    ),
)
