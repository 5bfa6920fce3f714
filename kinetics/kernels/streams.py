"""Random streams: xoshiro256++ (Blackman & Vigna 2021, doi:10.1145/3460772), one stream per run.

A stream is keyed by the seed and the number of its run, so it does not matter which thread makes the run, or when. An
event uses two words of 64 random bits: one for the wait and one for the choice of the channel, 53 bits a double.
"""

import math

import numpy as np

from kinetics.kernels.compiled import compiled

LN2 = math.log(2.0)
HALF_ROOT = 0x3FE6A09E667F3BCD  # the bits of the double sqrt(1/2)
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@compiled
def start_stream(key, run, stream):
    """Fill the four words of `stream` for this run: SplitMix64's mixing of each key word with the run's number."""
    for i in range(4):
        z = key[i] + np.uint64(run + 1) * GOLDEN
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        stream[i] = z ^ (z >> np.uint64(31))


@compiled
def next_word(s0, s1, s2, s3):
    """One step of xoshiro256++: 64 random bits, then the new state."""
    mixed = s0 + s3
    word = ((mixed << np.uint64(23)) | (mixed >> np.uint64(41))) + s0
    shifted = s1 << np.uint64(17)
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= shifted
    s3 = (s3 << np.uint64(45)) | (s3 >> np.uint64(19))
    return word, s0, s1, s2, s3


@compiled
def uniform(word):
    """A number in [0, 1) from 64 random bits."""
    return float(word >> np.uint64(11)) * 2.0**-53


@compiled
def exponential(word):
    """Unit exponential variate -log(1 - u) from 64 random bits; never 0. Within 4 units in the last place.

    Plain arithmetic, so that it gives the same bits alone and in vector lanes: 1 - u = m 2**k with m next to 1, and
    log m = 2 artanh(s), s = (m - 1)/(m + 1), |s| < 0.172, by eleven terms of its series.
    """
    bits = max(np.int64(word >> np.uint64(11)), np.int64(1))
    shifted = np.float64(1.0 - float(bits) * 2.0**-53).view(np.int64) + np.int64(0x3FF0000000000000 - HALF_ROOT)
    k = (shifted >> np.int64(52)) - np.int64(1023)
    m = np.int64((shifted & np.int64(0x000FFFFFFFFFFFFF)) + np.int64(HALF_ROOT)).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    z2 = z * z
    z4 = z2 * z2
    low = (1.0 + z * (1 / 3)) + z2 * ((1 / 5) + z * (1 / 7))
    middle = ((1 / 9) + z * (1 / 11)) + z2 * ((1 / 13) + z * (1 / 15))
    high = ((1 / 17) + z * (1 / 19)) + z2 * (1 / 21)
    return -(float(k) * LN2 + 2.0 * s * (low + z4 * (middle + z4 * high)))


@compiled
def draw(stream, waits, uniforms):
    """Fill `waits` with unit exponentials and `uniforms` with numbers in [0, 1), as `direct.advance` draws them."""
    s0, s1, s2, s3 = stream[0], stream[1], stream[2], stream[3]
    words = waits.view(np.uint64)
    for i in range(waits.size):
        words[i], s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        second, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        uniforms[i] = uniform(second)
    for i in range(waits.size):  # a loop of its own, for it runs in vector lanes, and the words cannot
        waits[i] = exponential(words[i])
    stream[0], stream[1], stream[2], stream[3] = s0, s1, s2, s3
