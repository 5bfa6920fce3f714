"""Derivatives of expected values at a time of small, stiff chains: the exponential and its derivative, squared.

Y(t), the mean over s from 0 to t of exp(Q (t - s)) f start exp(Q s), is over t the derivative of exp(Q t) in the
direction of the matrix f start, and t rate (Y_ji - Y_ii) is what a rate from i to j brings: one direction gives the
derivatives by all rates. It is squared along with E = exp(Q t), (E, Y) -> (E E, (E Y + Y E) / 2), by three products
(Van Loan 1978, doi:10.1109/TAC.1978.1101743; Najfeld & Havel 1995, doi:10.1006/aama.1995.1017; Al-Mohy & Higham 2009,
doi:10.1137/080716426).

The differences are as much smaller than Y as rates fire often until t. So all is in fixed-point arithmetic with as many
more bits (see `kinetics.markov.transient.certificate`), and the error is proven: with f at most 1, the rows of E and Y
add up to at most 1, so a squaring adds up the errors of Y and E, and doubles those of E alone.
"""

from __future__ import annotations

from math import ceil, frexp, log2
from typing import NamedTuple

import numpy as np

from kinetics.markov.derivatives.gradient import ChannelEntries, Gradient
from kinetics.markov.transient.certificate import (
    ABOVE,
    STEP_BITS,
    Entries,
    best_entries,
    exact_products,
    series_terms,
    short_rates,
)
from kinetics.markov.transient.dense import LARGEST
from kinetics.markov.transient.fixedpoint import FixedPoint
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.states import StateSpace
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats

MAX_SQUARED = 500  # states, some thirty seconds: three times what the dense method takes with its proof
RESULT_BITS = 50  # of a derivative, relative to the largest value


class Powers(NamedTuple):
    """E, and Y of each function, as digits (D + 1, N, N); bounds on the largest row sum of the error of E and of Y."""

    power: Floats
    means: list[Floats]
    power_error: float
    means_error: float


def gradient_by_squaring(
    entries: ChannelEntries, start: Floats, functions: Floats, time: float, space: StateSpace | None = None
) -> list[Gradient]:
    """Gradient of the means of F functions (F, N), none negative, at a time, tu; two products a squaring more for each.

    space : states of the network behind the chain, which give its rates without rounding
    ValueError: too many states, or rates and time beyond what numbers hold

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_by_squaring
    >>> stiff = Network.from_text("A <-> B, 1e6, 3e6")
    >>> entries = ChannelEntries(reachable(stiff, {"A": 1}).transitions(), n_channels=2)
    >>> (found,) = gradient_by_squaring(entries, np.array([1.0, 0.0]), np.array([[0.0, 1.0]]), time=1.0)
    >>> round(found.answer.value, 9), found.value.round(9).tolist()  # settled: 1/4, and 1/4 * 3/4
    (0.25, [0.1875, -0.1875])
    """
    chain, fastest = entries.transitions, float(entries.transitions.exits.max(initial=0.0))
    if chain.size > MAX_SQUARED:
        raise ValueError(f"{chain.size} states are too many to square the exponential, at most {MAX_SQUARED}")
    if not (1.0 / LARGEST < fastest < LARGEST and 1.0 / LARGEST < time < LARGEST):
        raise ValueError(f"rates up to {fastest:.3g} 1/tu and time {time:.3g} tu are beyond what numbers hold")
    known = best_entries(chain, space)
    is_exact = known.rate_error == 0.0  # what errors of rates add to gradient is not known here
    # scaled by powers of two, without rounding
    scales = [2.0 ** frexp(float(values.max()))[1] if values.any() else 1.0 for values in functions]
    shares = [values / scale for values, scale in zip(functions, scales, strict=True)]
    arithmetic = FixedPoint.of(chain.size + 1)
    at = _squared(arithmetic, known, start, shares, time)
    reached = start @ arithmetic.value(at.power)
    rows, columns, rates, *_ = chain
    gradient = []
    for scale, share, digits in zip(scales, shares, at.means, strict=True):
        gaps = arithmetic.value(arithmetic.carry(digits[:, columns, rows] - digits[:, rows, rows]))
        brought = rates * time * gaps
        wrong = ROUNDOFF * (chain.roundings + entries.most + 10.0) * np.abs(brought)
        wide = scale * entries.by_channel(wrong + 2.0 * rates * time * at.means_error)
        mean, relative = float(reached @ share), 2.0 * ROUNDOFF * (chain.size + 4)
        answer = Answer.within(mean * scale, relative, is_exact, ABOVE * at.power_error * scale)
        gradient.append(Gradient(answer, scale * entries.by_channel(brought), ABOVE * wide, is_exact))
    return gradient


def _squared(arithmetic: FixedPoint, known: Entries, start: Floats, functions: list[Floats], time: float) -> Powers:
    """E and Y at a time, right to 2**-RESULT_BITS divided by how often the fastest rate fires."""
    part, exponent = frexp(time)
    scaled = exact_products(known, part)  # time is part * 2**exponent
    exits = np.bincount(scaled.rows, np.abs(scaled.rates), minlength=start.size)
    squarings = max(exponent + ceil(log2(2.0 * exits.max())) + STEP_BITS, 0)
    bits = RESULT_BITS + 2 * squarings - STEP_BITS
    count = arithmetic.digits_for(bits)
    short, cut = short_rates(arithmetic, scaled, 2.0 ** (exponent - squarings), start.size, count)
    power, means, error, wrong = _short_step(arithmetic, short, cut, start, functions, count)
    for level in range(squarings):
        count = arithmetic.digits_for(bits - level)
        lost = arithmetic.lost(count)
        products = arithmetic.multiply
        means = [
            arithmetic.divide(arithmetic.carry(products(power, each, count) + products(each, power, count)), 2)
            for each in means
        ]
        wrong = (wrong + error) * (1.0 + error) + error * wrong + 2.0 * lost
        power = products(power, power, count)
        error = 2.0 * error + error**2 + lost
    return Powers(power, means, ABOVE * error, ABOVE * wrong)


def _short_step(
    arithmetic: FixedPoint, short: Floats, cut: float, start: Floats, functions: list[Floats], count: int
) -> Powers:
    """E and Y of a step so short that the rows of |Q| h add up to at most 2**-16, by Horner's rule on their series."""
    products, n, lost = arithmetic.multiply, start.size, arithmetic.lost(count)
    terms = series_terms(lost) + 1  # the series of Y has one power of Q h less
    begin = arithmetic.digits(start[None, :], count)
    values = [arithmetic.digits(each[:, None], count) for each in functions]
    power, diagonal = np.zeros_like(short), np.arange(n)
    means = [np.zeros_like(short) for _ in functions]
    for m in range(terms, 0, -1):
        power[0, diagonal, diagonal] += 1.0
        ahead = products(begin, power, count)
        means = [
            arithmetic.divide(arithmetic.carry(products(each, ahead, count) + products(short, mean, count)), m)
            for each, mean in zip(values, means, strict=True)
        ]
        power = arithmetic.divide(products(short, power, count), m)
    power[0, diagonal, diagonal] += 1.0
    # of E as in the certificate; a step for Y takes that of E on, and adds three products, a division and two roundings
    error = ABOVE * (cut + 3.0 * lost)
    return Powers(power, means, error, ABOVE * (error + cut + 8.0 * lost))
