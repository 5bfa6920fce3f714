"""Derivatives, by all rates, of moments, standard deviation and quantiles of a first-passage time.

With A the rates of leaving and changing the n transient states, y_m = A**-m 1 and o_m = start A**-m, the k-th moment
is k! start y_k, and its derivative by the logarithm of a channel's rates the sum over m = 1, ..., k, and over the
entries of the channel, of k! o_m rate (y_there - y_here), y being y_(k + 1 - m). All are positive and have relative
errors; what is subtracted is what bounds are made of.

Of F(t) = q the derivative of t is -(dF / d ln k) / f, with the density f, the mean of the rates h into the target. The
quantile is known between two bounds, and both are bounded in between. The mean of h |M|, M being the score of a path
(see `at_a_time`), is at most sqrt(mean h**2 * mean M**2), so |df / d ln k| is at most f + sqrt(max(h) f exits t).
And |df / dt| is at most the mean of exits h + Q h, which itself grows by 4 max(h) exits**2 a time unit at most.
"""

from __future__ import annotations

from dataclasses import replace
from math import factorial, sqrt
from typing import NamedTuple

import numpy as np

from kinetics.markov.derivatives.eventually import everywhere, flow_sums
from kinetics.markov.derivatives.gradient import ChannelEntries, Gradient
from kinetics.markov.passage.certified import BoundedSolution, Equations
from kinetics.markov.passage.until import UNDERFLOW, Mask, Solved, accumulated_until
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats

LARGEST_ORDER = 20  # of a moment: factorials up to here are exact


def gradient_moment(entries: ChannelEntries, start: Floats, target: Mask, order: int) -> Gradient:
    """Gradient of the mean of the time, tu, to a target (N,) that is certain, to the power of `order`.

    Cost: two solutions for each power up to `order`.

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_moment
    >>> entries = ChannelEntries(reachable(Network.from_text("A -> B, 2"), {"A": 1}).transitions(), n_channels=1)
    >>> found = gradient_moment(entries, np.array([1.0, 0.0]), np.array([False, True]), order=2)
    >>> round(found.answer.value, 9), found.value.round(9).tolist()  # 2 / k^2, and twice as much less
    (0.5, [-1.0])
    """
    ending = accumulated_until(entries.transitions, start, np.ones(start.size), target)
    solved = ending.solved
    if solved is None:
        return Gradient.none(ending.found, entries.n_channels)
    stopped, whole = entries._replace(transitions=solved.chain), float(factorial(order))
    values, times = _iterated(solved, order)
    parts = [flow_sums(stopped, here, there) for here, there in zip(times, reversed(values), strict=True)]
    value, wide = (whole * np.sum(each, axis=0) for each in zip(*parts, strict=True))
    wide = 1.01 * wide + (order + 2) * ROUNDOFF * whole * np.sum([np.abs(each) for each, _ in parts], axis=0)
    mean, relative = BoundedSolution(*(each[solved.transient] for each in values[-1])).mean(solved.first)
    is_bound = solved.chain.is_certified
    answer = Answer.within(whole * mean, relative + 2.0 * ROUNDOFF, is_bound)
    return Gradient(answer, value, wide + UNDERFLOW, is_bound)


def gradient_sd(entries: ChannelEntries, start: Floats, target: Mask, sd: Answer) -> Gradient:
    """Gradient of the standard deviation of the time, tu, to a target (N,) that is certain, by two moments.

    sd : the standard deviation itself, which is known

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_sd
    >>> from kinetics.support.answer import Answer
    >>> entries = ChannelEntries(reachable(Network.from_text("A -> B, 2"), {"A": 1}).transitions(), n_channels=1)
    >>> sd = Answer(0.5, 0.5, 0.5)
    >>> gradient_sd(entries, np.array([1.0, 0.0]), np.array([False, True]), sd).value.round(9).tolist()
    [-0.5]
    """
    if sd.value == 0.0:
        return Gradient.none(sd, entries.n_channels)
    one, two = (gradient_moment(entries, start, target, order) for order in (1, 2))
    twice = 2.0 * one.answer.value
    value = two.value - twice * one.value
    mean_wrong = one.answer.high - one.answer.low
    wide = two.wide + twice * one.wide + 2.0 * mean_wrong * (np.abs(one.value) + one.wide)
    wide += 4.0 * ROUNDOFF * (np.abs(two.value) + twice * np.abs(one.value))
    return _over(Gradient(sd, value, wide, one.is_bound), sd, 2.0)


class Density(NamedTuple):
    """The density of a passage time at its quantile.

    value : 1/tu, with bounds
    steepest : how fast it changes there at most, 1/tu**2
    most : the largest rate into the target, 1/tu; exits : out of any state before

    >>> from kinetics.markov.derivatives import Density
    >>> from kinetics.support.answer import Answer
    >>> Density(Answer(1.0, 1.0, 1.0), steepest=2.0, most=2.0, exits=2.0).value.value  # k / 2, k = 2
    1.0
    """

    value: Answer
    steepest: float
    most: float
    exits: float


def gradient_quantile(cdf: Gradient, quantile: Answer, density: Density, share: float = 1.0) -> Gradient:
    """Gradient of a quantile, tu, from those of the distribution function there.

    share : the largest d ln(rate) / d ln(parameter)

    >>> from math import log
    >>> import numpy as np
    >>> from kinetics.markov.derivatives import Density, Gradient, gradient_quantile
    >>> from kinetics.support.answer import Answer
    >>> half = log(2) / 2  # the median of an exponential time of rate 2
    >>> cdf = Gradient(Answer(0.5, 0.5, 0.5), np.array([half]), np.zeros(1), is_bound=True)
    >>> density = Density(Answer(1.0, 1.0, 1.0), steepest=2.0, most=2.0, exits=2.0)
    >>> gradient_quantile(cdf, Answer(half, half, half), density).value.round(6).tolist()  # less by as much
    [-0.346574]
    """
    found, most, exits = density.value, density.most, density.exits
    away = 1.001 * max(quantile.high - quantile.value, quantile.value - quantile.low)
    bend = away * (density.steepest + 4.0 * most * exits**2 * away)
    around = replace(found, low=max(found.low - bend, 0.0), high=found.high + bend)
    steeper = share * away * (around.high + sqrt(most * around.high * exits * quantile.high))
    is_bound = cdf.is_bound and found.is_bound and quantile.is_bound
    return _over(Gradient(quantile, 0.0 - cdf.value, cdf.wide + 1.01 * steeper, is_bound), around, 1.0)


def _over(gradient: Gradient, by: Answer, times: float) -> Gradient:
    """Gradient over a number that is known between bounds, so many times; infinitely wide where it may be 0."""
    if by.low <= 0.0:
        value = gradient.value / (times * by.value) if by.value else np.zeros_like(gradient.value)
        return gradient._replace(value=value, wide=np.full_like(gradient.wide, np.inf))
    value = gradient.value / (times * by.value)
    wrong = max(by.high - by.value, by.value - by.low)
    wide = (gradient.wide / times + np.abs(value) * wrong) / by.low + 4.0 * ROUNDOFF * np.abs(value)
    return gradient._replace(value=value, wide=1.01 * wide)


def _iterated(solved: Solved, order: int) -> tuple[list[BoundedSolution], list[BoundedSolution]]:
    """y_1, ..., y_k and o_1, ..., o_k, everywhere (N,)."""
    equation, transient = solved.equation, solved.transient
    values = [BoundedSolution(*(each[transient] for each in solved.solution))]
    times = [equation.occupied(solved.first)]
    for _ in range(order - 1):
        values.append(_again(equation, values[-1], False))
        times.append(_again(equation, times[-1], True))
    return [everywhere(transient, each) for each in values], [everywhere(transient, each) for each in times]


def _again(equation: Equations, weights: BoundedSolution, is_occupation: bool) -> BoundedSolution:
    """A solution for weights that are themselves known with bounds."""
    values, errors = (equation.occupied if is_occupation else equation.solved)(weights.values)
    more = equation.at_most(weights.errors, values, is_occupation)
    return BoundedSolution(values, 1.001 * (errors + (1.0 + equation.rates_error) * more))
