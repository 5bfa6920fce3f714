"""What the bound on the error of a solution says of means, standard deviations and distributions."""

from __future__ import annotations

import numpy as np

from kinetics.kernels.leap_limits import LARGEST_COUNT
from kinetics.markov.transient import Distribution
from kinetics.markov.transient.distribution import SLACK
from kinetics.network import Network
from kinetics.predicting.accuracy import AskedAccuracy
from kinetics.support.arrays import Floats, Ints


def largest_counts(network: Network, start: Ints) -> Floats:
    """Limits (S,) on the counts; inf where none is known.

    The stated conserved quantities set some, and so does the number of all copies where nothing makes it grow.
    """
    may_grow = bool(network.events) or _made(network).max(initial=0.0) > 0.0
    copies = float(sum(map(int, start)))
    if copies > LARGEST_COUNT:
        copies = float(np.nextafter(copies, np.inf))
    tops = np.full(len(network.species), np.inf if may_grow else copies)
    for weights in network.conserved.values():
        if weights.min() >= 0.0:
            shares = np.divide(
                weights @ start.astype(float), weights, out=np.full(tops.size, np.inf), where=weights > 0.0
            )
            tops = np.minimum(tops, np.floor(shares * (1.0 + 1e-12)))
    return tops


def is_endless(network: Network) -> bool:
    """Whether a channel that needs nothing makes copies for ever, so that no list of states ends."""
    if network.events or not network.is_mass_action:
        return False
    of_nothing = network.propensities(np.zeros(len(network.species), dtype=np.int64))
    return bool((of_nothing[_made(network) > 0.0] > 0.0).any())


def _made(network: Network) -> Floats:
    """Copies (R,) that a firing adds in all."""
    change = network.sparse_stoichiometry
    return np.bincount(change.rows, change.copies, minlength=len(network.channels)).astype(float)


def error_reached(asked: AskedAccuracy, found: Distribution, tops: Floats) -> float:
    """Limit on the error of `found`, in the unit of `asked`; inf where nothing is proven.

    tops : (S,) largest counts, inside the states of `found` and outside
    """
    if not found.is_bound:
        return np.inf
    if asked.of == "distribution":
        return found.error
    if not np.isfinite(tops).all():
        return np.inf
    rounding = SLACK * len(found.space)
    if asked.of == "mean":
        figures, errors = found.mean(), (found.error + rounding) * tops
    else:
        figures = found.sd()
        # as in `Distribution.covariance_bounds`: all of the error on the state farthest out, and it moves the mean
        off = (found.error + found.error**2 + 2 * rounding) * tops**2
        errors = np.maximum(
            np.sqrt(figures**2 + off) - figures, figures - np.sqrt(np.maximum(figures**2 - off, 0.0))
        ).max(axis=0)
    return asked.value * float((errors / asked.tolerances(figures)).max())


def tolerance_for(asked: AskedAccuracy, tops: Floats) -> float:
    """Largest error of all probabilities together by which the accuracy is sure to be reached."""
    if asked.of == "distribution":
        return asked.value
    least = asked.tolerances(np.zeros((1, tops.size)))  # relative ones are no less than those of one copy
    shares = least[tops > 0.0] / tops[tops > 0.0]
    return float((shares if asked.of == "mean" else shares**2).min(initial=1.0))
