"""Synthetic runs of the line of four with known rates, in the shapes that mechanics gives them."""

from dataclasses import replace
from functools import cache

import numpy as np

from kinetics.assembly import RuleBook, derive
from kinetics.network import Network
from kinetics.runs import RESTART, JumpPath
from kinetics.sampling import sample_path


@cache
def line_network() -> Network:
    """Line of four, k of joins 1e-3 and of breaks 0.05 per tu: rates scaled up, so that every channel fires often."""
    network = derive(RuleBook.load("line4")).network
    return network.with_rates(np.where(network.reactants.sum(axis=1) == 2, 1e-3, 0.05))


def restarted_run(network: Network, initial, end: float, rng: np.random.Generator) -> JumpPath:
    """A run put back to `initial` after every event; written from the law of the first event, without the SSA."""
    propensities = network.propensities(initial)
    total = propensities.sum()
    moments = np.cumsum(rng.exponential(1 / total, size=int(end * total + 10 * np.sqrt(end * total) + 30)))
    assert moments[-1] > end
    moments = moments[moments <= end]
    fired = rng.choice(propensities.size, size=moments.size, p=propensities / total)
    channels = np.column_stack([fired, np.full(moments.size, RESTART)]).ravel()
    return JumpPath(network, initial, np.repeat(moments, 2), channels, end)


def breaking_run(network: Network, initial, end: float, seed: int, run: int = 0) -> JumpPath:
    """A run without bonding: only breaks are open, and its products do not join again."""
    is_break = network.reactants.sum(axis=1) == 1
    path = sample_path(network.with_rates(network.known_rates * is_break), initial, end, seed=seed, run=run)
    return replace(path, network=network, open_channels=is_break)
