"""Probabilities carried over a step by uniformisation: every term is positive, so that relative errors add up."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from kinetics.markov.panels.panel_step import PanelStep
from kinetics.markov.passage.backward import LEFT_OUT, jump_rate, one_step, steps_until, weights_errors
from kinetics.markov.transient.poisson import ROUNDOFF, poisson_window
from kinetics.markov.transient.transitions import Transitions
from kinetics.markov.transient.uniformisation import MAX_STEPS, STEP_SECONDS
from kinetics.network import Network
from kinetics.support.arrays import Floats
from kinetics.support.cli.progress import forecast
from kinetics.support.packages import sparse
from kinetics.support.tables import rough

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
    there, relative = carried(chain, start, step.length, left_out)
    return Carried(step, chain, start, there, relative, float(there[-2]) + left_out)


def carried(chain: Transitions, start: Floats, time: float, left_out: float) -> tuple[Floats, float]:
    """Probabilities (N,) after a time, tu, from those at the start (N,), and the relative error of each.

    left_out : of the Poisson probability of more steps, which is beyond that error, as are numbers below 1e-300

    As `expected_from_all`, forwards. ValueError: too many steps
    """
    if time == 0.0 or not chain.rates.any():
        return start.copy(), 0.0
    steps = steps_until(chain, time)
    if steps > MAX_STEPS:
        raise ValueError(
            f"the chain is too stiff: {steps:.3g} steps between two looks {time:g} tu apart, at most {MAX_STEPS}"
        )
    forecast(steps * STEP_SECONDS * (start.size + chain.rates.size), f"{rough(steps)} steps from look to look")
    moves, stays, roundings = one_step(chain)
    # A state's sum has its own product among those of the states that lead to it.
    diagonal: Any = sparse.dia_array((stays[None, :], [0]), shape=moves.shape)
    into = sparse.csr_array(moves.T + diagonal)
    first, weights = poisson_window(jump_rate(chain) * time, left_out)
    now, found = start.copy(), np.zeros(start.size)
    for n in range(first + weights.size):
        if n >= first:
            found += weights[n - first] * now
        now = into @ now
    n_steps, mean = first + weights.size, jump_rate(chain) * time
    roundings += 2.0 * (int(np.bincount(chain.columns, minlength=1).max()) + 2.0)
    jumps = n_steps + float(chain.exits.max()) * time
    relative = n_steps * roundings + jumps * (chain.roundings + 1.0) + 2.0 * weights.size + 4.0
    return found, 1.01 * float(np.expm1(ROUNDOFF * relative) + weights_errors(mean, first, weights.size).max())
