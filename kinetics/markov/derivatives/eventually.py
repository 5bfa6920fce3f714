"""Derivatives, by all rates, of what happens at some time: reaching a target, the reward until then, the steady state.

A value y solves linear equations on the transient states, and its derivative by the logarithm of a channel's rates
is the sum over its entries, from i to j, of occupation_i * rate * (y_j - y_i): the reward gained in the time spent at
i by going on from j instead. Occupation and value come from one elimination, which also gives the value itself; both
have relative errors, so each term has a bound. After infinite time the occupation is the stationary distribution, and y
the reward beyond the mean before the chain is back at a state (Schweitzer 1968, doi:10.2307/3212261).

If a target is so remote that rates fire f times before it is reached, these derivatives lose as many digits as f
has. Those of a mean until a target, and of a probability, are then taken by cycles (see `regenerative`), with bounds
relative to the answer; those of `always`, of the steady state and of higher moments keep bounds
that are f times as wide.
"""

from __future__ import annotations

import numpy as np

from kinetics.markov.derivatives.gradient import ChannelEntries, Gradient
from kinetics.markov.derivatives.regenerative import First, by_cycles
from kinetics.markov.passage.certified import BoundedSolution
from kinetics.markov.passage.stationary import Stationary, stationary_of, steady_mean
from kinetics.markov.passage.until import UNDERFLOW, Ending, Mask, Solved, accumulated_until, always, rate_reward, until
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.support.arrays import Floats, Ints

LOOSE = 1e-8  # relative to the answer: from here on, cycles are worth their time


def gradient_until(entries: ChannelEntries, start: Floats, through: Mask, target: Mask) -> Gradient:
    """Gradient of the probability of reaching the target (N,) at some time, through given states (N,) alone.

    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_until
    >>> space = reachable(Network.from_text('''A -> B, 1
    ... A -> C, 3'''), {"A": 1})
    >>> entries = ChannelEntries(space.transitions(), n_channels=2)
    >>> begins, is_b = (space.states[:, s] == 1 for s in (0, 1))
    >>> gradient_until(entries, begins.astype(float), begins | is_b, is_b).value.round(9).tolist()  # 1/4 * 3/4
    [0.1875, -0.1875]
    """

    def until_back(inside: ChannelEntries, begins: Floats) -> Gradient:
        return _reached(inside, begins, np.append(through, False), np.append(target, False))

    ending = until(entries.transitions, start, through, target)
    return _narrower(entries, np.where(target, 0.0, start), ending, _of_ending(entries, ending), until_back)


def gradient_always(entries: ChannelEntries, start: Floats, states: Mask) -> Gradient:
    """Gradient of the probability of never leaving the states (N,).

    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_always
    >>> space = reachable(Network.from_text('''A -> B, 1
    ... A -> C, 3'''), {"A": 1})
    >>> entries = ChannelEntries(space.transitions(), n_channels=2)
    >>> begins, is_c = (space.states[:, s] == 1 for s in (0, 2))
    >>> gradient_always(entries, begins.astype(float), ~is_c).value.round(9).tolist()  # as of reaching B
    [0.1875, -0.1875]
    """
    return _of_ending(entries, always(entries.transitions, start, states))


def gradient_accumulated(
    entries: ChannelEntries, start: Floats, rewards: Floats, target: Mask, impulses: Floats | None = None
) -> Gradient:
    """Gradient of the mean of a reward until the target (N,) is reached.

    rewards : (N,) rates in each state; impulses : (K,) at each jump, none negative

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_accumulated
    >>> entries = ChannelEntries(reachable(Network.from_text("A -> B, 2"), {"A": 1}).transitions(), n_channels=1)
    >>> found = gradient_accumulated(entries, np.array([1.0, 0.0]), np.array([1.0, 0.0]), np.array([False, True]))
    >>> round(found.answer.value, 9), found.value.round(9).tolist()  # the mean time 1/k
    (0.5, [-0.5])
    """
    total, rounded = rate_reward(entries.transitions, rewards, impulses)
    ending = accumulated_until(entries.transitions, start, total, target)

    def until_back(inside: ChannelEntries, begins: Floats) -> Gradient:
        ends = np.append(target, True)
        cycle = accumulated_until(inside.transitions, begins, np.append(total, 0.0), ends)
        return _of_ending(inside, cycle, _going(inside, ends, impulses), rounded)

    found = _of_ending(entries, ending, _going(entries, target, impulses), rounded)
    return _narrower(entries, start, ending, found, until_back)


def gradient_steady(
    entries: ChannelEntries, start: Floats, rewards: Floats, impulses: Floats | None = None
) -> Gradient:
    """The gradient of the mean rate of a reward in the steady state, by all channels.

    rewards : (N,) rates in each state; impulses : (K,) at each jump, none negative

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_steady
    >>> entries = ChannelEntries(reachable(Network.from_text("A <-> B, 2, 3"), {"A": 1}).transitions(), n_channels=2)
    >>> found = gradient_steady(entries, np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    >>> round(found.answer.value, 9), found.value.round(9).tolist()  # 2/5, and 2/5 * 3/5
    (0.4, [0.24, -0.24])
    """
    chain, (values, rounded) = entries.transitions, rate_reward(entries.transitions, rewards, impulses)
    rest = stationary_of(chain, start)
    answer = steady_mean(rest, values).inflated(rounded)
    value, wide = np.zeros(entries.n_channels), np.zeros(entries.n_channels)
    ends = np.zeros(chain.size)
    share = BoundedSolution(rest.probabilities, (rest.error + 2.0 * ROUNDOFF) * rest.probabilities)
    for members, weight in zip(rest.classes, rest.weights, strict=True):
        mean = float(rest.probabilities[members] @ values[members]) / float(weight)
        ends[members] = mean
        if members.size > 1:
            beyond = _beyond_the_mean(entries, rest, members, values, mean, rounded)
            inside = BoundedSolution(*(_only(members, each) for each in share))
            parts = flow_sums(entries, inside, beyond)
            value, wide = value + parts[0], wide + parts[1]
    if len(rest.classes) > 1:
        passing = ~np.isin(np.arange(chain.size), np.concatenate(rest.classes)) & chain.reached_from(start > 0)
        if start[passing].any():
            solved = Solved.of(chain, start, passing, ends, np.zeros(chain.size))
            error = 2.0 * rest.error + rounded + (values.size + 4.0) * ROUNDOFF
            parts = flow_sums(entries, *_solutions(solved, error))
            value, wide = value + parts[0], wide + parts[1]
    if impulses is not None:
        parts = _direct(entries, share, impulses)
        value, wide = value + parts[0], wide + parts[1]
    return Gradient(answer, value, 1.01 * wide + UNDERFLOW, chain.is_certified)


def _narrower(entries: ChannelEntries, start: Floats, ending: Ending, found: Gradient, until_back: First) -> Gradient:
    """The gradient, tightened if its bounds are loose by cycles between visits of the most visited state."""
    solved = ending.solved
    if solved is None or found.wide.max(initial=0.0) <= LOOSE * found.answer.value:
        return found
    spent = everywhere(solved.transient, solved.equation.occupied(solved.first))
    back = int(np.argmax(spent.values * solved.chain.exits))
    near = by_cycles(entries, start, solved.transient, back, until_back, _reached)
    better = near.wide < found.wide
    return found._replace(
        value=np.where(better, near.value, found.value), wide=np.where(better, 1.01 * near.wide, found.wide)
    )


def _reached(entries: ChannelEntries, start: Floats, through: Mask, target: Mask) -> Gradient:
    return _of_ending(entries, until(entries.transitions, start, through, target))


def _going(entries: ChannelEntries, target: Mask, impulses: Floats | None) -> Floats | None:
    """The impulses of jumps that leave no target."""
    return None if impulses is None else impulses[~target[entries.transitions.rows]]


def _of_ending(
    entries: ChannelEntries, ending: Ending, impulses: Floats | None = None, rounded: float = 0.0
) -> Gradient:
    solved = ending.solved
    if solved is None:
        return Gradient.none(ending.found, entries.n_channels)
    stopped = entries._replace(transitions=solved.chain)
    times, values = _solutions(solved, rounded)
    value, wide = flow_sums(stopped, times, values)
    if impulses is not None:
        parts = _direct(stopped, times, impulses)
        value, wide = value + parts[0], wide + parts[1]
    return Gradient(ending.found.inflated(rounded), value, 1.01 * wide + UNDERFLOW, solved.chain.is_certified)


def _solutions(solved: Solved, rounded: float) -> tuple[BoundedSolution, BoundedSolution]:
    """Time spent in each state, and what is solved for, which has one more relative error."""
    values, errors = solved.solution
    spent = everywhere(solved.transient, solved.equation.occupied(solved.first))
    return spent, BoundedSolution(values, errors + rounded * values)


def everywhere(transient: Mask, solution: BoundedSolution) -> BoundedSolution:
    """A solution on the transient states, extended by 0 to all states (N,)."""
    values, errors = np.zeros(transient.size), np.zeros(transient.size)
    values[transient], errors[transient] = solution
    return BoundedSolution(values, errors)


def _beyond_the_mean(
    entries: ChannelEntries, rest: Stationary, members: Ints, values: Floats, mean: float, rounded: float
) -> BoundedSolution:
    """The reward from each state of a closed class, less the mean, until the chain is at its likeliest state."""
    chain = entries.transitions
    back = members[np.argmax(rest.probabilities[members])]
    is_back = np.arange(chain.size) == back
    transient = _only(members, np.ones(chain.size)).astype(bool) & ~is_back
    none = np.zeros(chain.size)
    solved = Solved.of(chain.stopped(is_back), none, transient, none, values)
    waits, late = everywhere(transient, solved.equation.solved(np.ones(int(transient.sum()))))
    (gains, wrong), losses = solved.solution, mean * waits
    wide = wrong + mean * late + rounded * gains + (rest.error + rounded + ROUNDOFF * (values.size + 4.0)) * losses
    return BoundedSolution(gains - losses, wide + ROUNDOFF * np.abs(gains - losses))


def _only(members: Ints, values: Floats) -> Floats:
    kept = np.zeros_like(values)
    kept[members] = values[members]
    return kept


def flow_sums(entries: ChannelEntries, times: BoundedSolution, values: BoundedSolution) -> tuple[Floats, Floats]:
    """Sums over the entries of each channel of time * rate * (value there - value here), and how far off they are."""
    rows, columns, rates, *_ = entries.transitions
    gaps, wrong = values.values[columns] - values.values[rows], values.errors[columns] + values.errors[rows]
    terms, size = times.values[rows] * rates * gaps, np.abs(gaps) + wrong
    rounded = ROUNDOFF * (entries.transitions.roundings + entries.most + 6.0) * times.values[rows]
    wide = rates * (times.errors[rows] * size + times.values[rows] * wrong + rounded * size)
    return entries.by_channel(terms), entries.by_channel(wide)


def _direct(entries: ChannelEntries, times: BoundedSolution, impulses: Floats) -> tuple[Floats, Floats]:
    """The impulse rewards at the jumps of each channel, all of which are in proportion to its rates."""
    rows, _, rates, *_ = entries.transitions
    value, wide = (entries.by_channel(each[rows] * rates * impulses) for each in times)
    return value, wide + ROUNDOFF * (entries.transitions.roundings + entries.most + 4.0) * value
