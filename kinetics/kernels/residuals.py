"""Residuals of a chain's linear equations, in double-double arithmetic, about 104 bits.

Sums without error by Knuth, products by Dekker (1971, doi:10.1007/BF01397083), additions of pairs as in Joldes, Muller
& Popescu (2017, doi:10.1145/3121432): each adds 2**-104 of its result at most. Products below 2**-969 lose digits.
"""

from kinetics.kernels.compiled import compiled


@compiled
def two_sum(a, b):
    """a + b as a double and what it rounds off."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@compiled
def two_product(a, b):
    """a * b as a double and what it rounds off."""
    product = a * b
    c = 134217729.0 * a  # 2**27 + 1
    a_high = c - (c - a)
    a_low = a - a_high
    c = 134217729.0 * b
    b_high = c - (c - b)
    b_low = b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


@compiled
def scaled(a, high, low):
    """a times a pair, as a pair."""
    product, rest = two_product(a, high)
    return two_sum(product, rest + a * low)


@compiled
def added(high, low, more_high, more_low):
    """The sum of two pairs, as a pair."""
    total, rest = two_sum(high, more_high)
    lower, lowest = two_sum(low, more_low)
    total, rest = two_sum(total, rest + lower)
    return two_sum(total, rest + lowest)


@compiled
def accumulated(rows, columns, rates, leaving, high, low, left, sizes):
    """Take A x from what is `left` (n, 2), where (A x)_i = leaving_i x_i + sum over j of rates_ij (x_i - x_j).

    x : pairs, `high` (n,) and `low` (n,); sizes : (n,) grow by the summed sizes of all terms
    """
    for i in range(leaving.size):
        a, b = scaled(leaving[i], high[i], low[i])
        left[i, 0], left[i, 1] = added(left[i, 0], left[i, 1], -a, -b)
        sizes[i] += leaving[i] * abs(high[i])
    for k in range(rates.size):
        i, j = rows[k], columns[k]
        a, b = added(high[i], low[i], -high[j], -low[j])
        a, b = scaled(rates[k], a, b)
        left[i, 0], left[i, 1] = added(left[i, 0], left[i, 1], -a, -b)
        sizes[i] += rates[k] * (abs(high[i]) + abs(high[j]))


@compiled
def occupied(rows, columns, rates, leaving, high, low, left, sizes):
    """Take x A from what is `left` (n, 2): what leaves each state less what comes to it; otherwise as `accumulated`."""
    for i in range(leaving.size):
        a, b = scaled(leaving[i], high[i], low[i])
        left[i, 0], left[i, 1] = added(left[i, 0], left[i, 1], -a, -b)
        sizes[i] += leaving[i] * abs(high[i])
    for k in range(rates.size):
        i, j = rows[k], columns[k]
        a, b = scaled(rates[k], high[i], low[i])
        left[i, 0], left[i, 1] = added(left[i, 0], left[i, 1], -a, -b)
        left[j, 0], left[j, 1] = added(left[j, 0], left[j, 1], a, b)
        sizes[i] += abs(a)
        sizes[j] += abs(a)


@compiled
def corrected(high, low, change):
    """Add `change` (n,) to pairs (n,), in place."""
    for i in range(high.size):
        high[i], low[i] = added(high[i], low[i], change[i], 0.0)
