"""Steps p <- p P of a uniformised Markov chain, P = 1 + Q / q (Jensen 1953), on a sparse generator.

A step adds to every state what flows in and takes what flows out: p + (inflow - outflow). All but the last addition
round in proportion to the flow, not to the probability, so a chain that mostly rests loses little. Places are unsigned:
Numba would look at each whether it counts from the end, which doubles the time of a step.
"""

import numpy as np

from kinetics.kernels.compiled import compiled


@compiled
def advance(begins, sources, shares, exits, vectors, flows):
    """Fill the rows of `vectors` after the first, each one step after the row before.

    begins : (N + 1,) uint32, where the inflow of each state begins in the next two
    sources : (K,) uint32, the state that it comes from
    shares : (K,) rate / q
    exits : (N,) exit rate / q, none above 1
    vectors : (B + 1, N), row 0 given
    flows : (B,) receives the mass that left its state in each step
    """
    n = exits.size
    for b in range(flows.size):
        now, after = vectors[b], vectors[b + 1]
        flow = 0.0
        end = begins[0]
        for i in range(n):
            inflow = 0.0
            begin, end = end, begins[i + 1]
            for k in range(begin, end):
                inflow += shares[k] * now[sources[k]]
            outflow = exits[i] * now[i]
            flow += outflow
            # Not negative: a rounded product with exits <= 1 is no larger than the probability itself.
            after[i] = now[i] + (inflow - outflow)
        flows[b] = flow


@compiled
def absorb(begins, sources, shares, exits, vector, absorbed, alive, flows):
    """Step on a chain whose last state is never left; before each step, note its mass and the summed rest.

    vector : (N,), changed in place
    absorbed, alive : (B,) receive the mass in the last state and in all others
    flows : (B,) receives the mass that left its state in each step
    """
    n = exits.size
    now = vector.copy()
    after = np.empty(n)
    for b in range(absorbed.size):
        absorbed[b] = now[n - 1]
        rest, flow = 0.0, 0.0
        end = begins[0]
        for i in range(n):
            if i < n - 1:
                rest += now[i]
            inflow = 0.0
            begin, end = end, begins[i + 1]
            for k in range(begin, end):
                inflow += shares[k] * now[sources[k]]
            outflow = exits[i] * now[i]
            flow += outflow
            after[i] = now[i] + (inflow - outflow)
        alive[b], flows[b] = rest, flow
        now, after = after, now
    vector[:] = now


@compiled
def mix(rows, weights, vectors, mixed):
    """Add to mixed[rows[a]] the sum over b of weights[a, b] * vectors[b].

    A matrix product in tiles that stay in the cache: BLAS would wake threads that cost more than they save.
    """
    tile = 64
    total = np.empty(tile)
    for left in range(0, vectors.shape[1], tile):
        right = min(left + tile, vectors.shape[1])
        for a in range(rows.size):
            total[:] = 0.0
            for b in range(weights.shape[1]):
                weight = weights[a, b]
                if weight != 0.0:
                    for j in range(left, right):
                        total[j - left] += weight * vectors[b, j]
            for j in range(left, right):
                mixed[rows[a], j] += total[j - left]


@compiled
def retreat(begins, targets, shares, stays, starts, chances, now, before, means):
    """Step backwards, v <- P v; before each step, note the mean of v over the start.

    begins : (N + 1,) uint32, where the moves out of each state begin in the next two
    targets : (K,) uint32, the state that each leads to
    shares : (K,) rate / q
    stays : (N,) what remains of 1
    starts, chances : (M,) states in which the chain begins, and their probabilities
    now, before : (N,) v, changed in place; receives v before the last step
    means : (B,) receives a mean a step
    """
    n = stays.size
    for b in range(means.size):
        mean = 0.0
        for m in range(starts.size):
            mean += chances[m] * now[starts[m]]
        means[b] = mean
        # v_i <- P_ii v_i + sum over moves i -> j of P_ij v_j, with v in `before`.
        now, before = before, now
        end = begins[0]
        for i in range(n):
            value = stays[i] * before[i]
            begin, end = end, begins[i + 1]
            for k in range(begin, end):
                value += shares[k] * before[targets[k]]
            now[i] = value
    if means.size % 2:
        for i in range(n):
            now[i], before[i] = before[i], now[i]


@compiled
def summed_steps(begins, sources, shares, stays, weights, now, sums):
    """Step, v <- M v; before each step, add weights[t, b] v to the sums.

    begins : (N + 1,) uint32, where the entries of each of M's rows off its diagonal begin in the next two
    sources : (K,) uint32, their columns
    shares : (K,) the entries
    stays : (N,) those on the diagonal
    weights : (T, B)
    now : (N,) v, changed in place; sums : (T, N)
    """
    n = stays.size
    after = np.empty(n)
    for b in range(weights.shape[1]):
        for t in range(weights.shape[0]):
            if weights[t, b] != 0.0:
                for i in range(n):
                    sums[t, i] += weights[t, b] * now[i]
        end = begins[0]
        for i in range(n):
            value = stays[i] * now[i]
            begin, end = end, begins[i + 1]
            for k in range(begin, end):
                value += shares[k] * now[sources[k]]
            after[i] = value
        now[:] = after


@compiled
def powers(begins, sources, shares, stays, vectors):
    """Fill the rows of `vectors` after the first, each one step after the row before, p <- p P.

    begins, sources, shares : the moves into each state, as in `advance`
    stays : (N,) what remains of 1
    vectors : (B + 1, N), row 0 given, none negative
    """
    for b in range(vectors.shape[0] - 1):
        now, after = vectors[b], vectors[b + 1]
        end = begins[0]
        for i in range(stays.size):
            total = stays[i] * now[i]
            begin, end = end, begins[i + 1]
            for k in range(begin, end):
                total += shares[k] * now[sources[k]]
            after[i] = total


@compiled
def steps_back(begins, ends, shares, stays, vectors, weights, after, values, later, gained, held, mixed):
    """Step backwards, and note what each move brings: `later` becomes P later + weights[b] values, b = B - 1, ..., 0.

    begins, ends, shares, stays : the K moves out of each state, as in `retreat`
    vectors : (B, N) probabilities before each step
    weights : (B,) of the values (N,); after : (B,) the sum of those of later steps
    later : (N,), changed in place
    gained : (K,) to which probability * (later there - later here) is added before each step
    held : (N,) to which probability * later is added likewise
    mixed : (N,) to which after[b] * probability is added
    """
    n = stays.size
    now, before = later.copy(), np.empty(n)
    for b in range(weights.size - 1, -1, -1):
        chances, weight, rest = vectors[b], weights[b], after[b]
        end = begins[0]
        for i in range(n):
            # The derivative of p P l by the entry P_ij at rows summing to 1 is p_i (l_j - l_i).
            here, chance = now[i], chances[i]
            total = stays[i] * here
            begin, end = end, begins[i + 1]
            for k in range(begin, end):
                there = now[ends[k]]
                total += shares[k] * there
                gained[k] += chance * (there - here)
            held[i] += chance * here
            mixed[i] += rest * chance
            before[i] = total + weight * values[i]
        now, before = before, now
    later[:] = now
