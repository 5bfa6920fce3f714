"""State reduction on a banded chain without subtractions (Grassmann, Taksar & Heyman 1985).

doi:10.1287/opre.33.5.1107. With q the rates and l those out of the chain, step k = n - 1, ..., 0 is
S_k = l_k + sum over j < k of q_kj, and for i, j < k: q_ij += (q_ik / S_k) q_kj, l_i += (q_ik / S_k) l_k.

band[i, j - i + b] is the rate from state i to state j, |i - j| <= b. Taking out the last state of a chain reroutes what
would have gone through it; its exit rate is summed anew from where it goes, never found by subtraction.
"""

from kinetics.kernels.compiled import compiled


@compiled(error_model="python")
def reduce(band, leaving, exits, begin, end):
    """Take out the states from `end` - 1 down to `begin`, in place; all of them from the last to the first, in parts.

    band : (n, 2b + 1); afterwards the rates downwards of the reduced chains, and upwards the shares of the exit rate
        of the state that they lead to
    leaving : (n,) rates out of the chain, likewise reduced
    exits : (n,) receives the exit rate of each state when it was the last
    Returns how often the rates out of a state were changed, all states together.
    """
    b = band.shape[1] // 2
    changes = 0
    for k in range(end - 1, begin - 1, -1):
        low = max(0, k - b)
        # Every later number depends on this sum: what its additions round off is added at the end (Knuth's two-sum).
        total, rest = leaving[k], 0.0
        for j in range(low, k):
            rate = band[k, j - k + b]
            larger = total + rate
            part = larger - total
            rest += (total - (larger - part)) + (rate - part)
            total = larger
        total += rest
        exits[k] = total
        if total == 0.0:
            continue
        # Reroute what went through state k: q_ij += (q_ik / S_k) q_kj, and likewise to the outside.
        for i in range(low, k):
            if band[i, k - i + b] == 0.0:
                continue
            share = band[i, k - i + b] / total
            band[i, k - i + b] = share
            changes += 1
            leaving[i] += share * leaving[k]
            shift = b - i
            for j in range(low, k):
                band[i, j + shift] += share * band[k, j - k + b]
    return changes


@compiled(error_model="python")
def solve(band, exits, x):
    """Reward accumulated until exit from each state, at reward rates x (n,); in place, after `reduce`.

    For k = n - 1, ..., 1: x_i += (q_ik / S_k) x_k for i < k. Then for k = 0, ...: x_k = (x_k + sum over j < k of
    q_kj x_j) / S_k.
    """
    n = exits.size
    b = band.shape[1] // 2
    # From the last state: its reward until exit counts for the states that lead to it.
    for k in range(n - 1, 0, -1):
        if x[k] != 0.0:
            for i in range(max(0, k - b), k):
                x[i] += band[i, k - i + b] * x[k]
    # Back substitution from the first state, each in the chain of the states before it.
    for k in range(n):
        total = x[k]
        for j in range(max(0, k - b), k):
            total += band[k, j - k + b] * x[j]
        x[k] = total / exits[k]


@compiled(error_model="python")
def occupy(band, exits, x):
    """Expected time in each state, from a start spread as x (n,); in place, after `reduce`.

    For k = n - 1, ..., 0: x_k = x_k / S_k, x_j += x_k q_kj for j < k. Then for k = 1, ...: x_k += sum over i < k of
    x_i q_ik / S_k.
    """
    n = exits.size
    b = band.shape[1] // 2
    for k in range(n - 1, -1, -1):
        x[k] /= exits[k]
        if x[k] != 0.0:
            for j in range(max(0, k - b), k):
                x[j] += band[k, j - k + b] * x[k]
    for k in range(1, n):
        for i in range(max(0, k - b), k):
            x[k] += x[i] * band[i, k - i + b]


@compiled(error_model="python")
def balance(band, x):
    """Weights (n,) of the stationary distribution of a chain that nothing leaves, up to a factor; after `reduce`.

    x_0 = 1, then for k = 1, ...: x_k = sum over i < k of x_i q_ik / S_k.
    """
    n = x.size
    b = band.shape[1] // 2
    x[0] = 1.0
    for k in range(1, n):
        x[k] = 0.0
        for i in range(max(0, k - b), k):
            x[k] += x[i] * band[i, k - i + b]
        # Scale down in time: only ratios count, and weights may grow beyond double.
        if x[k] > 1e200:
            for i in range(k + 1):
                x[i] *= 1e-200
