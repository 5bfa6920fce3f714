"""Poisson and binomial variates of any size, from a run's own stream of random words.

Small means by inversion; larger ones by transformed rejection (Hoermann 1993, doi:10.1016/0167-6687(93)90997-4 for
Poisson variates, algorithm PTRS, and doi:10.1080/00949659308811496 for binomial ones, BTRS). Probabilities are taken
from deviances, not from logarithms of factorials, so that they keep their digits at any mean (Loader 2000, "Fast and
accurate computation of binomial probabilities"). No normal approximation. Numbers up to 2**53.
"""

import math

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.streams import next_word, uniform

BY_INVERSION = 10.0  # means up to which it is quicker; the rejections hold from here on
WORDS_AT_MOST = 8  # of bits that are counted for a number of halves; more cost more than a rejection
LOG_ROOT = 0.5 * math.log(2.0 * math.pi)


@compiled
def draw_word(stream):
    """64 random bits; `stream` (4,) is changed in place."""
    word, stream[0], stream[1], stream[2], stream[3] = next_word(stream[0], stream[1], stream[2], stream[3])
    return word


@compiled
def draw_uniform(stream):
    """A number in [0, 1)."""
    return uniform(draw_word(stream))


@compiled
def poisson(mean, stream):
    """A Poisson variate."""
    if not mean > 0.0:
        return 0
    if mean < BY_INVERSION:
        return small_poisson(mean, stream)
    b = 0.931 + 2.53 * math.sqrt(mean)
    a = -0.059 + 0.02483 * b
    scale = 1.1239 + 1.1328 / (b - 3.4)
    certain = 0.9277 - 3.6224 / (b - 2.0)
    whole = math.floor(mean)
    while True:
        u = draw_uniform(stream) - 0.5
        v = 1.0 - draw_uniform(stream)  # never 0
        edge = 0.5 - abs(u)
        if edge <= 0.0:
            continue
        k = whole + math.floor((2.0 * a / edge + b) * u + (mean - whole) + 0.43)
        if edge >= 0.07 and v <= certain:
            return int(k)
        if k < 0.0 or (edge < 0.013 and v > edge):
            continue
        if math.log(v * scale / (a / (edge * edge) + b)) <= log_poisson(k, mean):
            return int(k)


@compiled
def binomial(n, p, stream):
    """A binomial variate: how many of n happen, each with probability p."""
    if n <= 0 or not p > 0.0:
        return 0
    if p >= 1.0:
        return n
    if p > 0.5:
        return n - at_most_half(n, 1.0 - p, stream)
    return at_most_half(n, p, stream)


@compiled
def halved(n, stream):
    """A binomial variate of n with probability 1/2; for small n, by counting bits."""
    if n > 64 * WORDS_AT_MOST:
        return at_most_half(n, 0.5, stream)
    found = 0
    while n > 0:
        word = draw_word(stream)
        found += ones_of(word >> np.uint64(64 - n) if n < 64 else word)
        n -= 64
    return found


@compiled
def ones_of(word):
    """The number of bits that are 1, added in parallel in fields of growing width."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@compiled
def small_poisson(mean, stream):
    """A variate by inversion from 0 upwards, drawn again if rounding leaves the draw beyond all numbers."""
    while True:
        left, k, part = draw_uniform(stream), 0, math.exp(-mean)
        while left >= part > 0.0:
            left -= part
            k += 1
            part *= mean / k
        if part > 0.0:
            return k


@compiled
def at_most_half(n, p, stream):
    """A binomial variate, p at most 1/2."""
    mean = n * p
    if mean < BY_INVERSION:
        return small_binomial(n, p, stream)
    sd = math.sqrt(mean * (1.0 - p))
    b = 1.15 + 2.53 * sd
    a = -0.0873 + 0.0248 * b + 0.01 * p
    scale = (2.83 + 5.1 / b) * sd
    certain = 0.92 - 4.2 / b
    whole = math.floor(mean)
    mode = math.floor(mean + p)
    while True:
        u = draw_uniform(stream) - 0.5
        v = 1.0 - draw_uniform(stream)
        edge = 0.5 - abs(u)
        if edge <= 0.0:
            continue
        k = whole + math.floor((2.0 * a / edge + b) * u + (mean - whole) + 0.5)
        if edge >= 0.07 and v <= certain:
            return int(k)
        if k < 0.0 or k > n:
            continue
        if math.log(v * scale / (a / (edge * edge) + b)) <= log_binomial(k, n, p) - log_binomial(mode, n, p):
            return int(k)


@compiled
def small_binomial(n, p, stream):
    """A variate by inversion from 0 upwards."""
    while True:
        left, k, part = draw_uniform(stream), 0, math.exp(n * math.log1p(-p))
        while left >= part > 0.0 and k < n:
            left -= part
            k += 1
            part *= (n - k + 1) / k * (p / (1.0 - p))
        if left < part:
            return k


@compiled
def log_poisson(k, mean):
    """Logarithm of the probability of k."""
    if k == 0.0:
        return -mean
    return -stirling_rest(k) - deviance(k, mean) - 0.5 * math.log(k) - LOG_ROOT


@compiled
def log_binomial(k, n, p):
    """Logarithm of the probability of k of n."""
    if k == 0.0:
        return n * math.log1p(-p)
    if k == n:
        return n * math.log(p)
    rest = stirling_rest(n) - stirling_rest(k) - stirling_rest(n - k)
    return rest - deviance(k, n * p) - deviance(n - k, n * (1.0 - p)) - LOG_ROOT - 0.5 * math.log(k * (1.0 - k / n))


@compiled
def stirling_rest(n):
    """log n! less Stirling's formula log(sqrt(2 pi n) (n / e)**n), n at least 1."""
    if n < 16.0:
        return math.lgamma(n + 1.0) - (n + 0.5) * math.log(n) + n - LOG_ROOT
    z = 1.0 / (n * n)
    return (1 / 12 - z * (1 / 360 - z * (1 / 1260 - z * (1 / 1680 - z * (1 / 1188))))) / n


@compiled
def deviance(k, mean):
    """k log(k / mean) + mean - k: where both are close, by a series in their difference, which is exact."""
    if abs(k - mean) >= 0.1 * (k + mean):
        return k * math.log(k / mean) + mean - k
    ratio = (k - mean) / (k + mean)
    total = (k - mean) * ratio
    term = 2.0 * k * ratio
    j = 1
    while True:
        term *= ratio * ratio
        j += 2
        more = total + term / j
        if more == total:
            return total
        total = more
