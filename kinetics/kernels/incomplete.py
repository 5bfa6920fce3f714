"""Incomplete factors of a chain's equations, and the iteration that they precondition.

A = exits - rates is an M-matrix. Incomplete elimination takes out one state after another, the first one first, and
where that would lead to a pair of states without a rate, the chain is left instead: Meijerink & van der Vorst (1977),
doi:10.1090/S0025-5718-1977-0438681-4. Written so, with exit rates that are summed anew, nothing is subtracted
(Grassmann, Taksar & Heyman 1985, doi:10.1287/opre.33.5.1107), and chains without such pairs are solved exactly.

Rates are rows of a compressed table: `begins` (n + 1,), and in each row rising `columns` (K,) without the diagonal.
"""

import numpy as np

from kinetics.kernels.compiled import compiled


@compiled
def reduce(begins, columns, shares, leaving, middles, exits):
    """Take out the states from the first to the last, in place.

    shares : (K,) the rates; afterwards, below the diagonal the shares of the exit rate of the state they lead to
    leaving : (n,) rates out of the chain; afterwards of the reduced ones
    middles : (n,) receives where the entries above the diagonal begin; exits : (n,) the exit rates of reduced chains
    """
    n = exits.size
    places = np.full(n, -1)
    for i in range(n):
        for e in range(begins[i], begins[i + 1]):
            places[columns[e]] = e
        lost = leaving[i]
        e = begins[i]
        while e < begins[i + 1] and columns[e] < i:
            k = columns[e]
            share = shares[e] / exits[k]
            shares[e] = share
            lost += share * leaving[k]
            # Reroute what went through state k; without an entry for the pair, it leaves the chain.
            for f in range(middles[k], begins[k + 1]):
                j = columns[f]
                if j != i:
                    if places[j] >= 0:
                        shares[places[j]] += share * shares[f]
                    else:
                        lost += share * shares[f]
            e += 1
        middles[i] = e
        # Up to here what leaves the chain; with the rates that stay, the exit rate, summed and never subtracted.
        leaving[i] = lost
        for f in range(e, begins[i + 1]):
            lost += shares[f]
        exits[i] = lost
        for f in range(begins[i], begins[i + 1]):
            places[columns[f]] = -1


@compiled
def solve(begins, middles, columns, shares, exits, x):
    """Reward accumulated until exit in the chain of the factors, at reward rates x (n,); in place."""
    n = exits.size
    # Forward with the shares below the diagonal, then backward with the rates above it.
    for i in range(n):
        total = x[i]
        for e in range(begins[i], middles[i]):
            total += shares[e] * x[columns[e]]
        x[i] = total
    for i in range(n - 1, -1, -1):
        total = x[i]
        for e in range(middles[i], begins[i + 1]):
            total += shares[e] * x[columns[e]]
        x[i] = total / exits[i]


@compiled
def occupy(begins, middles, columns, shares, exits, x):
    """Expected time in each state of the chain of the factors, from a start spread as x (n,); in place."""
    n = exits.size
    for i in range(n):
        here = x[i] / exits[i]
        x[i] = here
        if here != 0.0:
            for e in range(middles[i], begins[i + 1]):
                x[columns[e]] += here * shares[e]
    for i in range(n - 1, -1, -1):
        here = x[i]
        if here != 0.0:
            for e in range(begins[i], middles[i]):
                x[columns[e]] += here * shares[e]


@compiled
def accumulated(begins, columns, rates, exits, x, result):
    """Compute A x (n,)."""
    for i in range(exits.size):
        total = 0.0
        for e in range(begins[i], begins[i + 1]):
            total += rates[e] * x[columns[e]]
        result[i] = exits[i] * x[i] - total


@compiled
def occupied(begins, columns, rates, exits, x, result):
    """Compute x A (n,)."""
    n = exits.size
    for i in range(n):
        result[i] = exits[i] * x[i]
    for i in range(n):
        here = x[i]
        for e in range(begins[i], begins[i + 1]):
            result[columns[e]] -= rates[e] * here
