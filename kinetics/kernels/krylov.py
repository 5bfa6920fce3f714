"""Corrections of a chain's linear equations by a Krylov method, each residual in units of its own equation.

BiCGSTAB (van der Vorst 1992, doi:10.1137/0913035), with incomplete factors applied first.
"""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.incomplete import earned, occupied, occupy, solve


@compiled
def correct(begins, middles, columns, shares, reduced, rates, exits, is_occupation, units, left, change, goal, most):
    """Add to `change` (n,) what takes the residuals `left` (n,) away, in place: to `goal` in `units` (n,) of each.

    begins, middles, columns, shares, reduced : incomplete factors, see `incomplete.reduce`
    rates, exits : the equations; is_occupation : of x A, else of A x
    Returns the number of rounds, at most `most`; where the method breaks down, it stops with what it has.
    """
    n = exits.size
    first = np.empty(n)
    step, moved, bent = np.zeros(n), np.zeros(n), np.empty(n)
    far, near = np.empty(n), np.empty(n)
    shrinks = 1.0 / units
    for i in range(n):
        left[i] *= shrinks[i]
        first[i] = left[i]
    before, alpha, omega = 1.0, 1.0, 1.0
    for k in range(most):
        product = 0.0
        for i in range(n):
            product += first[i] * left[i]
        beta = (product / before) * (alpha / omega) if k else 0.0
        before = product
        for i in range(n):
            step[i] = left[i] + beta * (step[i] - omega * moved[i])
            far[i] = step[i] * units[i]
        if is_occupation:
            occupy(begins, middles, columns, shares, reduced, far)
            occupied(begins, columns, rates, exits, far, moved)
        else:
            solve(begins, middles, columns, shares, reduced, far)
            earned(begins, columns, rates, exits, far, moved)
        product = 0.0
        for i in range(n):
            moved[i] *= shrinks[i]
            product += first[i] * moved[i]
        alpha = before / product
        if not np.isfinite(alpha) or alpha == 0.0:
            return k
        for i in range(n):
            left[i] -= alpha * moved[i]
            near[i] = left[i] * units[i]
        if is_occupation:
            occupy(begins, middles, columns, shares, reduced, near)
            occupied(begins, columns, rates, exits, near, bent)
        else:
            solve(begins, middles, columns, shares, reduced, near)
            earned(begins, columns, rates, exits, near, bent)
        product, square = 0.0, 0.0
        for i in range(n):
            bent[i] *= shrinks[i]
            product += bent[i] * left[i]
            square += bent[i] * bent[i]
        omega = product / square if square > 0.0 else 0.0
        largest = 0.0
        for i in range(n):
            change[i] += alpha * far[i] + omega * near[i]
            left[i] -= omega * bent[i]
            largest = max(largest, abs(left[i]))
        if largest <= goal or omega == 0.0 or not np.isfinite(largest):
            return k + 1
    return most
