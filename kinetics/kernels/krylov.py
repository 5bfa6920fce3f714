"""Corrections of a chain's linear equations by a Krylov method, each residual in units of its own equation.

BiCGSTAB (van der Vorst 1992, doi:10.1137/0913035), with incomplete factors applied first.
"""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.incomplete import accumulated, occupied, occupy, solve


@compiled
def correct(
    begins, middles, columns, shares, reduced, rates, exits, is_occupation, units, left, change, goal, memory, numbers,
    done, most,
):  # fmt: skip
    """Add to `change` (n,) what takes the residuals `left` (n,) away, in place: to `goal` in `units` (n,) of each.

    begins, middles, columns, shares, reduced : incomplete factors, see `incomplete.reduce`
    rates, exits : the equations; is_occupation : of x A, else of A x
    memory (4, n), numbers (3,) : what one call leaves for the next, so that each may be short; `done` rounds so far
    Returns the number of rounds, at most `most`, and whether no more are needed; if the method breaks down, it
    stops with what it has.
    """
    n = exits.size
    first, step, moved, bent = memory
    far, near = np.empty(n), np.empty(n)
    shrinks = 1.0 / units
    if done == 0:
        for i in range(n):
            left[i] *= shrinks[i]
            first[i] = left[i]
            step[i] = moved[i] = 0.0
        numbers[:] = 1.0
    before, alpha, omega = numbers
    # Names of the paper: left = r, first = r_0 hat, step = p, far = K^-1 p, moved = v = A far, near = K^-1 s, bent = t.
    for k in range(done, most):
        # beta = (rho_k / rho_(k-1)) (alpha / omega), p = r + beta (p - omega v).
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
            accumulated(begins, columns, rates, exits, far, moved)
        product = 0.0
        for i in range(n):
            moved[i] *= shrinks[i]
            product += first[i] * moved[i]
        # alpha = rho / (r_0 hat, v); not finite or 0 is a breakdown, which keeps the correction so far.
        alpha = before / product
        if not np.isfinite(alpha) or alpha == 0.0:
            return k, True
        # s = r - alpha v.
        for i in range(n):
            left[i] -= alpha * moved[i]
            near[i] = left[i] * units[i]
        if is_occupation:
            occupy(begins, middles, columns, shares, reduced, near)
            occupied(begins, columns, rates, exits, near, bent)
        else:
            solve(begins, middles, columns, shares, reduced, near)
            accumulated(begins, columns, rates, exits, near, bent)
        product, square = 0.0, 0.0
        for i in range(n):
            bent[i] *= shrinks[i]
            product += bent[i] * left[i]
            square += bent[i] * bent[i]
        # omega = (t, s) / (t, t), the length that makes the residual smallest.
        omega = product / square if square > 0.0 else 0.0
        # x += alpha K^-1 p + omega K^-1 s, r = s - omega t.
        largest = 0.0
        for i in range(n):
            change[i] += alpha * far[i] + omega * near[i]
            left[i] -= omega * bent[i]
            largest = max(largest, abs(left[i]))
        if largest <= goal or omega == 0.0 or not np.isfinite(largest):
            return k + 1, True
    numbers[0], numbers[1], numbers[2] = before, alpha, omega
    return most, False
