"""Predictive p-values and ranges: where something seen ranks among the same thing in simulated groups."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kinetics.support.arrays import Floats

ENOUGH = 5  # groups on the nearer side, with the one seen, after which a p-value is known well enough


def predictive_p(seen: Floats, simulated: Floats) -> Floats:
    """Two-sided p-values (K,) of `seen` (K,) by its rank among `simulated` (D, K).

    Where what was seen is one more group like the others, its rank is uniform on 1, ..., D + 1, so that p, twice the
    share of groups, itself included, on the nearer side, is at most a with probability a for each a that it can be:
    exact. Groups equal to what was seen count on both sides: p is then larger, and small with probability below a.

    >>> import numpy as np
    >>> predictive_p(np.array([0.0, 0.0]), np.array([[0.0, 1.0], [0.0, 2.0], [1.0, 3.0]])).tolist()
    [1.0, 0.5]
    """
    at_most, at_least = (simulated <= seen).sum(axis=0), (simulated >= seen).sum(axis=0)
    return np.asarray(np.minimum(2 * (1 + np.minimum(at_most, at_least)) / (len(simulated) + 1), 1.0))


def least_p(groups: int) -> float:
    """The smallest two-sided p-value that so many groups can give."""
    return 2 / (groups + 1)


def looks(first: int, most: int) -> tuple[int, ...]:
    """Numbers of groups after which p-values are looked at: the first, about twice as many each time, and all.

    >>> looks(1999, 9_999)
    (1999, 3999, 7999, 9999)
    """
    numbers = [first]
    while 2 * numbers[-1] + 1 < most:
        numbers.append(2 * numbers[-1] + 1)
    return (*numbers, most) if first < most else (first,)


def clear_p(groups: int) -> float:
    """The p-value among so many groups from which on no more are simulated: the rank is ENOUGH from the nearer end."""
    return ENOUGH * least_p(groups)


def sequential_p(seen: Floats, numbers: Sequence[int], groups: Callable[[int], Floats]) -> tuple[Floats, Floats]:
    """`predictive_p` (K,) among as many groups as each takes to be clear; the least possible (K,).

    numbers : of groups, rising, as `looks` gives them; `groups(n)` returns values (n, K) of the first n, and is asked
        for more of them only if some p-value is not clear yet

    Besag & Clifford (1991), Biometrika 78:301, doi 10.1093/biomet/78.2.301, looked at after given numbers of groups:
    what is clearly above 2 ENOUGH / n stops at n groups with a relative error of about 1 / sqrt(ENOUGH), what may be
    below the level that is asked for gets all of them. Valid at every level a: let n be the first number with
    `clear_p(n)` <= a. A p-value that stopped earlier was at least the `clear_p` of its number, so above a; one that did
    not is at most a only if the p-value among n groups is (what goes on beyond n was below `clear_p(n)`), and that
    has probability at most a. With a below all of them the last number decides alike.
    """
    p, least = np.full(seen.shape, np.nan), np.full(seen.shape, np.nan)
    is_open = np.ones(seen.shape, dtype=bool)
    for n in numbers:
        p[is_open] = predictive_p(seen[is_open], groups(n)[:, is_open])
        least[is_open] = least_p(n)
        is_open &= p < clear_p(n)
        if not is_open.any():
            break
    return p, least


def upper_p(seen: float, simulated: Floats) -> float:
    """Share of the groups, the one seen included, with at least this value."""
    return float((1 + np.count_nonzero(simulated >= seen)) / (1 + simulated.size))


def shown_p(p: float, least: float = 0.0) -> str:
    """A p-value as text; the smallest that is possible is an upper bound."""
    return f"p ≤ {p:.1g}" if p <= least else f"p = {p:.2g}"
