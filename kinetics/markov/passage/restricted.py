"""First passage up to a horizon: the restricted mean of survival analysis, and the probability of arriving."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinetics.markov.passage.arrival import SMALL
from kinetics.markov.passage.backward import expected_at, steps_until
from kinetics.markov.passage.entry import reached_states
from kinetics.markov.passage.first_passage import lumped
from kinetics.markov.transient.poisson import ROUNDOFF, poisson_window, window_error
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.uniformisation import MAX_STEPS, DiscreteChain
from kinetics.native import twins
from kinetics.network import Network
from kinetics.support.arrays import Counts, Floats, rising_times, whole_number
from kinetics.support.cli.progress import forecast
from kinetics.support.tables import rough

TOLERANCE = 1e-13  # probability that uniformisation may leave out


@dataclass(frozen=True)
class RestrictedPassage:
    """The time min(T, horizon) until a target is reached or the horizon comes, tu.

    mean, sd : of that time; both exist however unlikely the target is
    reached : probability that the target is reached by the horizon, from 0 to 1
    mean_error, reached_error : limits on the absolute errors of mean and probability; of a small probability close
        relative to it
    n_states : states of the chain, those with the target included
    is_bound : whether these limits are proven; not by a rate law that cannot be bounded
    """

    horizon: float
    mean: float
    sd: float
    reached: float
    mean_error: float
    reached_error: float
    n_states: int
    is_bound: bool = True


def restricted_passage(
    network: Network,
    initial: Counts,
    species: str,
    horizon: float,
    copies: int = 1,
    max_states: int = MAX_STATES,
    max_seconds: float = 7200.0,
) -> RestrictedPassage:
    """Time from `initial` until there first are `copies` of a species, in which none by `horizon`, tu, counts with it.

    max_states, max_seconds : a ValueError where there are more states, or where it would take longer by a rough
        estimate

    The moments of min(T, horizon) are integrals of the survival function, those of what it leaves of the horizon are
    integrals of the distribution function. By uniformisation at rate q the terms of both are Poisson probabilities,
    whose integrals are Poisson tails P(N > n) / q. Moments and probability are sums of positive terms, in which nothing
    cancels. The sd is the root of a difference of two moments, of the time or of what it leaves, whichever is smaller
    in the mean square; only where the sd is far below both does it lose digits, and it has no bound on its error.
    About q * horizon steps over all states, and no linear equations: choose it over `first_passage` where the states
    are many or the target may never be reached. (Jensen 1953 for uniformisation; Royston & Parmar 2013 for the mean.)
    """
    end = float(rising_times([horizon])[0])
    index, wanted = network.index(species), whole_number("copies", copies, 0)
    space = reached_states(network, initial, max_states, stop=lambda states: states[:, index] >= wanted)
    if space.is_stopped[0] or end == 0.0:
        return RestrictedPassage(end, 0.0, 0.0, float(space.is_stopped[0]), 0.0, 0.0, len(space))
    jumps = space.transitions()
    going, start = lumped(jumps, space.is_stopped, np.eye(1, len(space))[0])
    chain = DiscreteChain.of(going)
    # The window's own arrays have a place for each step, so the bound comes first.
    steps = chain.steps_until(end, TOLERANCE) if chain.rate * end < np.inf else np.inf
    if steps > MAX_STEPS or not steps * chain.step_seconds <= max_seconds:
        raise ValueError(
            f"{len(space)} states would take {steps:.3g} steps until {end:g} tu, up to "
            f"{steps * chain.step_seconds:.3g} s; at most {MAX_STEPS} steps and max_seconds = {max_seconds:g} are "
            f"allowed: choose an earlier horizon, start from fewer copies, or sample"
        )
    forecast(steps * chain.step_seconds, f"{rough(steps)} steps over {len(space)} states")
    first, weights = poisson_window(chain.rate * end, TOLERANCE)
    absorbed, alive, rounding = _absorption(chain, start, first + weights.size)
    tails = np.ones(first + weights.size + 1)  # P(N > n) for n = 0, 1, ...: certain before the window, 0 after it
    tails[first:] = np.append(np.cumsum(weights[::-1])[::-1][1:], [0.0, 0.0])
    # Moments in units of 1/q, of the time and of what it leaves of the horizon.
    mean, left = float(alive @ tails[:-1]), float(absorbed @ tails[:-1])
    square = 2.0 * float((alive * np.arange(1, alive.size + 1)) @ tails[1:])
    left_square = 2.0 * float(absorbed @ np.cumsum(tails[:0:-1])[::-1])
    variance = min((square, square - mean**2), (left_square, left_square - left**2))[1]
    reached, error = (
        float(absorbed[first:] @ weights),
        window_error(chain.rate * end, first, weights, TOLERANCE) + rounding,
    )
    if reached < SMALL and steps_until(going, end) <= MAX_STEPS:
        found = expected_at(going, start, np.eye(1, start.size, start.size - 1)[0], end)
        wide = max(found.high - found.value, found.value - found.low)
        reached, error = min((reached, error), (found.value, wide), key=lambda each: each[1])
    return RestrictedPassage(
        end,
        min(mean / chain.rate, end),
        max(variance, 0.0) ** 0.5 / chain.rate,
        min(reached, 1.0),
        rounding * end + _tails_error(chain.rate * end, first, weights) / chain.rate,
        error,
        len(space),
        jumps.is_certified,
    )


def _absorption(chain: DiscreteChain, start: Floats, n_steps: int) -> tuple[Floats, Floats, float]:
    """Probabilities (n_steps,) of being and of not being in the last state after 0, 1, ... steps.

    And a bound on the rounding of either.
    """
    vector = start.copy()
    absorbed, alive, flows = np.empty((3, n_steps))
    twins.absorb(*chain.arrays, vector, absorbed, alive, flows)
    rounding = chain.rounding(n_steps, float(flows.sum())) + ROUNDOFF * (n_steps + chain.size + 2)
    return absorbed, alive, rounding


def _tails_error(mean: float, first: int, weights: Floats) -> float:
    """Bound on the summed error of P(N > n) over all n.

    What a tolerance leaves out of a Poisson number on either side adds at most the mean as often as that, and scaling
    the rest up for it twice as much; the weights round as in `window_error`, in proportion, and so do their sums.
    """
    numbers = np.arange(first, first + weights.size)
    roundings = 2.0 * np.abs(numbers - int(mean)) + 2.0 * mean**0.5 + weights.size + 60.0
    return 4.0 * TOLERANCE * mean + ROUNDOFF * float(numbers @ (weights * roundings))
