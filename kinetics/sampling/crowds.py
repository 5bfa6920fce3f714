"""Networks in a crowd as the kernels of the direct method sample them: mass action, thinned to the crowd's factors.

Lewis & Shedler (1979, doi:10.1002/nav.3800260304), for jump processes. Over all states that the conserved quantities
allow, the factor f of a channel lies between a low one L and (1 + ratio) L. Propensities with L in the place of f are
of mass action; an event that they alone bring about is one of the network. Candidates come besides, at `ratio` times
those propensities; one is kept with probability (f - L) / (ratio L), for which alone f is computed, and else changes
nothing. So a channel fires at the rate that its factor gives it, exactly, and most events cost what they always did.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from kinetics.network import Network
from kinetics.network.crowding import ROUNDED
from kinetics.support.arrays import Floats, Ints

MOST_RATIO = 100.0  # of a highest factor to the lowest; beyond, nearly all candidates would be thrown away


class Thinning(NamedTuple):
    """What the kernels read of a crowd, beside G merged channels made from R of a network.

    ratio : candidates to each event at the low factors
    first : of the channels that the crowd changes, which are the last ones
    spans (G + 1,), coefficients, partners, less (R,) : of the channels that are merged, see `members.Members`; the
        coefficients hold the low factors at s = 0
    slopes (R,) : by which low factors rise with s, relative to those at s = 0
    weights, volumes (S,) : as in `network.Crowding`
    factors (R, D) : coefficients of f / low factor at s = 0, less 1, in the form of `network.Crowding`
    """

    ratio: float
    first: int
    spans: np.ndarray
    coefficients: np.ndarray
    partners: np.ndarray
    less: np.ndarray
    slopes: np.ndarray
    weights: np.ndarray
    volumes: np.ndarray
    factors: np.ndarray


def has_bounds(network: Network, start: Ints | None = None) -> bool:
    """Whether the factors of the network's crowd, if there is one, have useful bounds from counts `start` (S,).

    start : None for whether they have bounds from any counts
    """
    crowding = network.crowding
    if crowding is None:
        return True
    if start is None and any(amount.min() > 0 for amount in network.conserved.values()):
        return True
    low, high = crowding.ranges(network.conserved, np.zeros(len(network.species)) if start is None else start)
    if start is None or not high[0] < inf or not high[1] < 1:
        return bool(high[0] < inf and high[1] < 1)
    return are_near(*crowding.factors_at([low[0], high[0]], [1 - low[1], 1 - high[1]]))


def are_near(least: Floats, most: Floats) -> bool:
    """Whether highest factors (R,) are at most `MOST_RATIO` times the lowest."""
    return bool((most <= MOST_RATIO * least).all())


def thinning_of(network: Network, start: Ints, spans: Ints, members: Ints, partners: Ints, less: Floats) -> Thinning:
    """The thinning of runs from counts `start` (S,); its coefficients (R,) are the low factors alone.

    spans, members, partners, less : of the merged channels, see `merging.Merging`; in the order of `members`
    ValueError: factors without bounds, or too far apart

    Low factors are such that merged channels still share sums. Beside bodies they have the form a_channel b_partner, so
    that weights stay alike; at walls they may rise with s, which as a sum over bodies goes into that of the weights.
    """
    if (crowding := network.crowding) is None:
        raise ValueError("the network has no crowd")
    (s, phi), (most_s, most_phi) = crowding.ranges(network.conserved, start)
    is_bounded = most_s < inf and most_phi < 1
    surfaces, free = np.array([s, s, most_s]), 1 - np.array([phi, most_phi, most_phi])
    if is_bounded:
        least, most_there, most = crowding.factors_at(surfaces, free)[:, members]
    if not is_bounded or not are_near(least, most):
        raise ValueError(f"{unbounded(network)}: use the method 'general', or 'auto'")
    least = least * (1 - ROUNDED)
    sizes, n_species = np.diff(spans), len(network.species)
    group = np.repeat(np.arange(sizes.size), sizes)
    is_body = (sizes > 1)[group] & (partners < n_species)
    g, p = group[is_body], partners[is_body]
    of_partner, of_group = np.full(n_species, inf), np.full(sizes.size, inf)
    np.minimum.at(of_partner, p, least[is_body])
    np.minimum.at(of_group, g, least[is_body] / of_partner[p])
    low, slopes = least.copy(), np.zeros(least.size)
    low[is_body] = of_group[g] * of_partner[p]
    is_wall = (sizes > 1)[group] & (partners == n_species) & (of_group < inf)[group]
    if is_wall.any() and s > 0:
        # The tangent at the lowest s lies below a factor, which is convex in s; all are as steep as the flattest.
        powers = np.arange(1, crowding.coefficients.shape[1] - 1)
        steep = crowding.coefficients[:, 2:] @ (powers * s ** (powers - 1) / (1 - phi) ** (powers + 1))
        steep = np.minimum(steep[members], 0.5 * least / s)[is_wall]
        scale = of_group[group[is_wall]]
        rise = (1 - ROUNDED) * scale * (steep / scale).min()
        low[is_wall] -= rise * s
        slopes[is_wall] = rise / low[is_wall]
    ratios = np.maximum(most_there / (low * (1 + slopes * s)), most / (low * (1 + slopes * most_s)))
    ratio = float(ratios.max(initial=1.0)) * (1 + ROUNDED) - 1.0
    factors = crowding.coefficients[members] / low[:, None]
    factors[:, 0] -= 1.0
    first = int(group[crowding.is_changed[members]].min(initial=sizes.size))
    tables = low, partners, less, slopes, crowding.weights, crowding.volumes, factors
    return Thinning(ratio, first, spans, *tables)


def unbounded(network: Network) -> str:
    """That the factors of a network's crowd have no bounds that serve."""
    known = ", ".join(network.conserved) or "none"
    return (
        f"the factors of the crowd have no upper bound within {MOST_RATIO:g} times the lower one; conserved quantities "
        f"that bound the surface and volume of all bodies would give one, here: {known}"
    )
