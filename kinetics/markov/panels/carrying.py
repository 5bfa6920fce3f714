"""Probabilities carried over a step by uniformisation: every term is positive, so that relative errors add up."""

from __future__ import annotations

from typing import NamedTuple

from kinetics.markov.panels.panel_step import PanelStep
from kinetics.markov.passage.backward import LEFT_OUT, uniformised
from kinetics.markov.transient.transitions import Transitions
from kinetics.network import Network
from kinetics.support.arrays import Floats

FORGOTTEN = 1e-60  # of the Poisson probability, before a look after which the state is known
SHORT = 1e-20  # of the Poisson probability of a window, next to what the likely states leave out


class Carried(NamedTuple):
    """A step at the rates of a network, with what it made of the probabilities at its beginning.

    chain : of its N + 2 states
    start, there : probabilities (N + 2,) at the beginning, which sum to 1, and at the end
    relative : error of each of those at the end
    left : bound on the probability that is in none of the states that matter at the end, although it may lead there
    """

    step: PanelStep
    chain: Transitions
    start: Floats
    there: Floats
    relative: float
    left: float


def carry(step: PanelStep, network: Network, chances: Floats) -> Carried:
    """A step from the probabilities (M,) of the states in which it begins."""
    chain, start = step.chain(network), step.start(chances)
    left_out = SHORT if step.is_projected else FORGOTTEN if len(step.ends) == 1 else LEFT_OUT
    (there,), relative = uniformised(chain, start, [step.length], is_backwards=False, left_out=left_out)
    return Carried(step, chain, start, there, relative, float(there[-2]) + left_out)
