"""A first guess of a stationary distribution."""

import numpy as np

from kinetics.kernels.compiled import compiled


@compiled
def balanced(begins, columns, rates, exits, logs):
    """Logarithms (n,) of probabilities that balance each state with the one that a search in width finds it from.

    Where a chain is reversible they are those of its distribution; a state without a way back at once counts as if all
    its ways led there. Rates are rows of a compressed table with rising columns; every state is found from the first.
    """
    n = exits.size
    found, queue = np.zeros(n, np.bool_), np.empty(n, np.int64)
    found[0], queue[0], logs[0] = True, 0, 0.0
    end = 1
    for at in range(n):
        if at == end:
            break
        i = queue[at]
        for e in range(begins[i], begins[i + 1]):
            j = columns[e]
            if not found[j]:
                back = exits[j]
                for f in range(begins[j], begins[j + 1]):
                    if columns[f] == i:
                        back = rates[f]
                logs[j] = logs[i] + np.log(rates[e]) - np.log(back)
                found[j] = True
                queue[end] = j
                end += 1
