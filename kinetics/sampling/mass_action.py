"""The propensities of a mass-action network, in the form that the fast kernels read.

They evaluate the one form that mass action of any order takes, see `MassAction`. Other laws are programs for the
kernel of the method `general`.
"""

from __future__ import annotations

from math import factorial
from typing import NamedTuple

import numpy as np

from kinetics.network import Network
from kinetics.network.propensity import over_factorial

MOST_LIKE = 1000  # copies; the ordered choices of 400 times any rate constant are beyond 1.8e308 already
FACTORIALS = np.array([float(factorial(m)) for m in range(171)])


class MassAction(NamedTuple):
    """Propensities of R channels among S species; a species index of S stands for the constant 1.

    coefficients (R,) : 1/tu
    first, second (R,) int32, less (R,) : the propensity is coefficient * x[first] * (x[second] - less), which is 0 on
        its own for want of copies
    is_general (R,) bool : it takes the factors instead: those of other orders, and like pairs counted as s * s
    factors (R, K, 3) int32 : factor j reads species [r, j, 0], subtracts [r, j, 1] copies, and is 0 below [r, j, 2]
    """

    coefficients: np.ndarray
    first: np.ndarray
    second: np.ndarray
    less: np.ndarray
    is_general: np.ndarray
    factors: np.ndarray


def order_refusal(network: Network) -> str:
    """Why a channel has too many like reactants, the first such channel named; empty if none has."""
    needed = network.sparse_reactants
    is_law = np.array([name in network.laws for name in network.channels], dtype=bool)
    free = ~is_law[needed.rows]
    many = free & (needed.copies > MOST_LIKE)
    if many.any():
        i = int(many.argmax())
        return (
            f"channel {network.channels[needed.rows[i]]!r} needs {needed.copies[i]} copies of one species; sampling "
            f"takes at most {MOST_LIKE}: write the reaction in steps of fewer reactants"
        )
    like = free & (needed.copies > 1)
    if network.combinations != "distinct" or network.rate_constants is None or not like.any():
        return ""
    shares = network.known_rates * network.ways
    with np.errstate(over="ignore", under="ignore"):
        np.divide.at(shares, needed.rows[like], FACTORIALS[np.minimum(needed.copies[like], 170)])
    is_beyond = np.bincount(needed.rows[like], needed.copies[like] > 170, len(network.channels)) > 0
    small = (shares < 2 * np.finfo(np.float64).tiny) | is_beyond
    for r in np.flatnonzero(np.bincount(needed.rows[like & small[needed.rows]])).tolist():
        try:
            _coefficient(network, r)
        except ValueError as error:
            return str(error)
    return ""


def _coefficient(network: Network, r: int) -> float:
    """The coefficient of a channel: rate constant times multiplicity over the factorials of its reactants' copies."""
    coefficient = float(network.known_rates[r] * network.ways[r])
    for copies in network.sparse_reactants.row(r)[1].tolist():
        coefficient = over_factorial(coefficient, copies, network.channels[r])
    return coefficient


def mass_action(network: Network) -> MassAction:
    """Coefficients, pairs and factors of every channel of a network of mass action alone."""
    coefficients = network.known_rates * network.ways
    needed = network.sparse_reactants
    n_channels = len(network.channels)
    if network.combinations == "distinct":
        for r in np.flatnonzero(np.bincount(needed.rows[needed.copies > 1])).tolist():
            coefficients[r] = _coefficient(network, r)
    order = int(np.bincount(needed.rows, needed.copies, minlength=n_channels).max(initial=2))
    factors = np.zeros((n_channels, order, 3), dtype=np.int32)
    factors[:, :, 0] = len(network.species)  # the constant 1, until a reactant takes the place
    channel = np.repeat(needed.rows, needed.copies)
    species = np.repeat(needed.columns, needed.copies)
    copies = np.repeat(needed.copies, needed.copies)
    firsts = np.cumsum(needed.copies) - needed.copies
    taken = np.arange(channel.size) - np.repeat(firsts, needed.copies)  # 0, 1, ... among like copies
    place = np.arange(channel.size) - np.searchsorted(channel, channel)
    if network.combinations == "product":
        factors[channel, place] = np.stack([species, np.zeros_like(taken), copies], axis=1)
    else:
        factors[channel, place] = np.stack([species, taken, taken + 1], axis=1)
    first, second = factors[:, 0], factors[:, 1]
    # Not a like pair counted as a product, and no third reactant.
    is_plain = (first[:, 1] == 0) & (first[:, 2] <= 1) & (factors[:, 2:, 2] == 0).all(axis=1)
    return MassAction(
        coefficients,
        np.ascontiguousarray(first[:, 0]),
        np.ascontiguousarray(second[:, 0]),
        second[:, 1].astype(float),
        ~is_plain,
        factors,
    )
