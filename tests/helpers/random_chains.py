"""Small random chains, and their exact answers by mpmath in a hundred digits from the rates alone."""

import mpmath
import numpy as np

DIGITS = 100


def random_rates(seed, n, decades=2.0, density=0.5):
    """Rates (n, n) off the diagonal that span some decades; a ring keeps the chain in one piece."""
    rng = np.random.default_rng(seed)
    rates = 10.0 ** rng.uniform(-decades, decades, (n, n)) * (rng.random((n, n)) < density)
    rates[np.arange(n), (np.arange(n) + 1) % n] += 0.5
    np.fill_diagonal(rates, 0.0)
    return rates


def exact_generator(rates, stopped=()):
    """Q as mpmath matrix; stopped states are never left."""
    n = len(rates)
    q = mpmath.zeros(n)
    for i in range(n):
        if i not in stopped:
            for j in range(n):
                q[i, j] = mpmath.mpf(float(rates[i, j]))
            q[i, i] = -sum(q[i, j] for j in range(n) if j != i)
    return q


def exact_law(rates, start, time, stopped=()):
    """Probabilities at a time, as mpmath numbers."""
    with mpmath.workdps(DIGITS):
        row = mpmath.matrix([[mpmath.mpf(float(p)) for p in start]])
        return list(row * mpmath.expm(exact_generator(rates, stopped) * mpmath.mpf(float(time))))
