/* Random streams and what follows from a draw; the arithmetic of streams.py, clock.py and blocks.py, to the last bit. */

#ifndef WELLMIXED_STREAMS_H
#define WELLMIXED_STREAMS_H

#include <stdint.h>
#include <string.h>

#define BLOCK 8

enum { REACHED_END, UNFINISHED, STALLED_CLOCK, OVERFLOW_, STOPPED = 14 }; /* as in outcomes.py */

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#define RARE __attribute__((noinline, cold)) /* kept away from the code of ordinary events */
#else
#define INLINE static inline
#define RARE
#endif

/* The same code also for processors with wider vectors, chosen as it is loaded. No clone may fuse a multiplication
 * with an addition, which would round otherwise: hence no "fma" here, and -ffp-contract=off. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__gnu_linux__)
#define CLONES __attribute__((target_clones("avx2", "default")))
#else
#define CLONES
#endif

INLINE double as_double(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

INLINE uint64_t as_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* A word of the state of a run's stream: SplitMix64 of the key, at the number of the run. */
INLINE uint64_t stream_word(uint64_t key, int64_t run)
{
    uint64_t z = key + (uint64_t)(run + 1) * 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

INLINE void start_stream(const uint64_t *key, int64_t run, uint64_t *stream)
{
    for (int j = 0; j < 4; j++)
        stream[j] = stream_word(key[j], run);
}

/* xoshiro256++ (Blackman & Vigna 2021, doi:10.1145/3460772). */
INLINE uint64_t next_word(uint64_t *s0, uint64_t *s1, uint64_t *s2, uint64_t *s3)
{
    const uint64_t mixed = *s0 + *s3;
    const uint64_t word = ((mixed << 23) | (mixed >> 41)) + *s0;
    const uint64_t shifted = *s1 << 17;
    *s2 ^= *s0;
    *s3 ^= *s1;
    *s1 ^= *s2;
    *s0 ^= *s3;
    *s2 ^= shifted;
    *s3 = (*s3 << 45) | (*s3 >> 19);
    return word;
}

/* A number below 2**53 as a double, exactly, by steps that all vector units have. */
INLINE double converted(uint64_t number)
{
    const double low = as_double((number & 0xFFFFFFFFu) | 0x4330000000000000u) - 0x1p52;
    const double high = as_double((number >> 32) | 0x4530000000000000u) - 0x1p84;
    return high + low;
}

/* Uniform in [0, 1): the upper 53 bits. */
INLINE double uniform(uint64_t word)
{
    return converted(word >> 11) * 0x1p-53;
}

/* A unit exponential, -ln(1 - u), u from the upper 53 bits and never 0: by 1 - u = 2**k m with m in [0.707, 1.414), and
 * ln m = 2 artanh(s), s = (m - 1) / (m + 1), as a series whose order of additions streams.py shares. */
INLINE double exponential(uint64_t word)
{
    uint64_t bits = word >> 11;
    bits = bits > 1 ? bits : 1;
    const uint64_t shifted =
        as_bits(1.0 - converted(bits) * 0x1p-53) + (0x3FF0000000000000u - 0x3FE6A09E667F3BCDu);
    /* k, at least -53 and at most 0, by adding it to a double whose last bit counts ones */
    const double k = as_double((shifted >> 52) - 1023 + 0x4338000000000000u) - 0x1.8p52;
    const double m = as_double((shifted & 0x000FFFFFFFFFFFFFu) + 0x3FE6A09E667F3BCDu);
    const double s = (m - 1.0) / (m + 1.0);
    const double z = s * s, z2 = z * z, z4 = z2 * z2;
    const double low = (1.0 + z * (1.0 / 3)) + z2 * ((1.0 / 5) + z * (1.0 / 7));
    const double middle = ((1.0 / 9) + z * (1.0 / 11)) + z2 * ((1.0 / 13) + z * (1.0 / 15));
    const double high = ((1.0 / 17) + z * (1.0 / 19)) + z2 * (1.0 / 21);
    return -(k * 0x1.62e42fefa39efp-1 + 2.0 * s * (low + z4 * (middle + z4 * high)));
}

#endif
