"""The factor h(s, t) of a propensity k * N * h: combinations of reactants under mass action, or another rate law.

It is computed from rows: the reactants of a channel and their copies; `laws.of_channels` has the law that takes the
place of h, if any.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, factorial, lgamma, log, perm

import numpy as np

from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Floats, Ints

# What h(s) counts for m like reactants among s copies:
#   distinct  sets of m copies, s!/(m!(s-m)!), for a pair s(s-1)/2
#   ordered   sequences of m copies, s!/(s-m)!, for a pair s(s-1)
#   product   s**m, zero below m copies: the paper's multiplicity M in eqs 9-10, taken to the letter
COMBINATIONS = ("distinct", "ordered", "product")
# So many like reactants among 2**63 - 1 copies still have fewer combinations than a float can hold.
LOW_ORDER = 16
LOG_LARGEST = 710.0  # of a float, rounded up
# What becomes of a rate law that is above 0 although reactants are missing:
#   block   the channel waits until they are there
#   refuse  a ValueError that names the channel and the state
AT_ZERO = ("block", "refuse")


def combinations(copies: Ints, taken: int, counted: str) -> Floats:
    """Ways (...) to take `taken` of `copies` (...), counted as one of `COMBINATIONS`; cost: `taken` products.

    Floats: 1e15 copies do not overflow. ValueError if the number is beyond all floats, 1.8e308.
    """
    if taken > LOW_ORDER:
        return _combinations_of_many(copies, taken, counted)
    available = copies.astype(np.float64)
    if counted == "product":  # not by the library's power, which rounds more often
        return np.where(copies >= taken, np.prod([available] * taken, axis=0), 0.0)
    # With fewer copies than taken, one of the factors is exactly 0; the clip keeps the others from going below.
    ordered: Floats = np.prod([np.maximum(available - i, 0.0) for i in range(taken)], axis=0)
    return ordered if counted == "ordered" else ordered / factorial(taken)


def _product(copies: int, taken: int) -> int:
    return int(copies**taken) if copies >= taken else 0


def _combinations_of_many(copies: Ints, taken: int, counted: str) -> Floats:
    """Combinations of each count, from exact integers rounded once: numerator and denominator may exceed a float."""
    exact = {"distinct": comb, "ordered": perm, "product": _product}[counted]
    found, where = np.unique(copies, return_inverse=True)
    try:
        if _least_log(int(found[-1]), taken, counted) > LOG_LARGEST:
            raise OverflowError
        values = np.array([float(exact(s, taken)) for s in found.tolist()])
    except OverflowError:
        raise ValueError(
            f"{taken} like reactants among {found[-1]} copies have more combinations ({counted!r}) than a float can "
            f"hold, 1.8e308; start from smaller counts, or write the reaction in steps of fewer reactants"
        ) from None
    return values[where].reshape(copies.shape)


def _least_log(copies: int, taken: int, counted: str) -> float:
    """A number that the logarithm of the combinations is not below: the whole number itself may take minutes."""
    if copies < taken:
        return -np.inf
    if counted == "distinct":  # (n/k)**k
        k = min(taken, copies - taken)
        return k * log(copies / k) if k else 0.0
    return lgamma(taken + 1.0) if counted == "ordered" else taken * log(copies)


def mass_action(needed: SparseTable, counts: Ints, counted: str, channels: Sequence[str]) -> Floats:
    """Combinations (..., R) of the reactants of every channel in states (..., S); cost: their product."""
    h = np.ones((*counts.shape[:-1], len(channels)))
    places = np.arange(needed.rows.size) - needed.starts[needed.rows]  # first, second, ... reactant of its channel
    for place, taken in set(zip(places.tolist(), needed.copies.tolist(), strict=True)):
        alike = (places == place) & (needed.copies == taken)
        rows, columns = needed.rows[alike], needed.columns[alike]
        try:
            with np.errstate(over="raise"):
                h[..., rows] *= combinations(counts[..., columns], taken, counted)
        except (ValueError, FloatingPointError) as error:
            most = counts.reshape(-1, counts.shape[-1]).max(axis=0)  # the channel that finds the most copies of its own
            name = channels[int(rows[np.argmax(most[columns])])]
            raise ValueError(f"channel {name!r}: its reactants have too many combinations: {error}") from None
    return h


def over_factorial(coefficient: float, copies: int, channel: str) -> float:
    """A coefficient divided by copies!, as sampling needs it for like reactants counted as distinct sets.

    ValueError if that is no normal float any more, from 171 copies on or with a small rate constant.
    """
    share = coefficient / float(factorial(copies)) if copies <= 170 else 0.0
    if coefficient > 0 and share < np.finfo(np.float64).tiny:
        raise ValueError(
            f"channel {channel!r} needs {copies} copies of one species: {coefficient:g} over {copies}! is too small "
            f"for a float; write the reaction in steps of fewer reactants"
        )
    return share


def state_text(species: Sequence[str], state: Ints) -> str:
    """A state as text; species at 0 are left out if there are many."""
    pairs = [(name, int(n)) for name, n in zip(species, state, strict=True) if n or len(species) <= 8]
    text = ", ".join(f"{name} = {n}" for name, n in pairs[:12])
    return text + (f" and {len(pairs) - 12} more" if len(pairs) > 12 else "") if pairs else "no copies at all"
