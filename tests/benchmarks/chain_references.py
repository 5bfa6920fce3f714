"""Answers about chains in 80-bit floats, from the generator alone, to measure the error of quicker ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinetics import Chain

Wide = np.longdouble
MOST_FILLED = 12_000  # states for which sparse LU is tried
ITERATIONS = 5_000
SETTLED = 1e-17  # relative change of the slowest value


def reference(chain: Chain, question: str, time: float) -> float | None:
    """P of the target by a time, U of the target before "bad", T until the target, S of "bad"; None: too expensive."""
    rates = _rates(chain)
    target, bad = (np.asarray(chain.labels[name]) for name in ("target", "bad"))
    start = int(np.argmax(np.asarray(chain.initial)))
    if question == "P":
        return _at_a_time(rates, target, start, time)
    if question == "S":
        return _in_the_end(rates, bad)
    stops = target | bad if question == "U" else target
    inside = rates[~stops][:, ~stops].tocsr()
    exits = np.asarray(rates.sum(axis=1)).ravel()[~stops]
    earned = np.asarray(rates[~stops][:, target].sum(axis=1)).ravel() if question == "U" else np.ones(exits.size)
    solution = _solved(inside, exits, earned.astype(Wide))
    return None if solution is None else float(solution[int(np.cumsum(~stops)[start]) - 1])


def _rates(chain: Chain) -> Any:
    from scipy.sparse import csr_array

    rates = csr_array(chain.transitions.generator()).astype(Wide)
    rates.setdiag(0)
    rates.eliminate_zeros()
    return rates


def _at_a_time(rates: Any, target: Any, start: int, time: float) -> float:
    """By steps of the uniformised chain, with target states that are never left."""
    from scipy.sparse import diags_array

    moves = diags_array((~target).astype(Wide)) @ rates
    exits = np.asarray(moves.sum(axis=1)).ravel()
    q = exits.max()
    step = ((moves - diags_array(exits)) / q + diags_array(np.ones(exits.size, Wide))).T.tocsr()
    mean = float(q) * time
    last = int(mean + 12.0 * mean**0.5 + 60.0)
    weights = _poisson(Wide(q) * Wide(time), last)
    vector, total = np.zeros(exits.size, Wide), Wide(0)
    vector[start] = 1
    for weight in weights:
        total += weight * vector[target].sum()
        vector = step @ vector
    return float(total)


def _poisson(mean: Any, last: int) -> Any:
    """Weights of 0, ..., last, from the mode outwards."""
    mode = int(mean)
    up = np.cumprod(mean / np.arange(mode + 1, last + 1).astype(Wide))
    down = np.cumprod(np.arange(mode, 0, -1).astype(Wide) / mean)[::-1]
    weights = np.concatenate([down, [Wide(1)], up])
    return weights / weights.sum()


def _solved(inside: Any, exits: Any, earned: Any) -> Any:
    """x with exits x - inside x = earned: by LU and residuals where the states are few, else by Jacobi's iteration."""
    if exits.size <= MOST_FILLED:
        refined = _refined(inside, exits, earned)
        if refined is not None:
            return refined
    x = earned / exits
    for n in range(ITERATIONS):
        after = (earned + inside @ x) / exits
        if n % 50 == 0 and (np.abs(after - x) <= SETTLED * np.abs(x)).all():
            return after
        x = after
    return None


def _refined(inside: Any, exits: Any, earned: Any) -> Any:
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import splu

    reached = np.bincount(inside.indices, minlength=exits.size).max()
    if exits.size > 3_500 and reached < 30 and _is_tangled(inside):
        return None
    factors: Any = splu(
        csc_array((diags_array(exits) - inside).astype(np.float64)),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    x = np.zeros(exits.size, Wide)
    for _ in range(6):
        residual = earned - (exits * x - inside @ x)
        x = x + factors.solve(residual.astype(np.float64))
    return x


def _is_tangled(inside: Any) -> bool:
    """Whether elimination would fill everything: no order keeps the rates together."""
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    pattern = (abs(inside) + abs(inside.T)).astype(np.float64).tocsr()
    place = np.empty(pattern.shape[0], dtype=int)
    place[reverse_cuthill_mckee(pattern, symmetric_mode=True)] = np.arange(place.size)
    entries = pattern.tocoo()
    return bool(np.abs(place[entries.row] - place[entries.col]).max(initial=0) > place.size / 4)


def _in_the_end(rates: Any, held: Any) -> float | None:
    """The share of the states after infinite time: balance of one class, with the first state's weight set to 1."""
    flows = rates.T.tocsr()
    exits = np.asarray(rates.sum(axis=1)).ravel()
    rest = _solved(flows[1:][:, 1:].tocsr(), exits[1:], flows[1:][:, [0]].toarray().ravel())
    if rest is None:
        return None
    weights = np.append(Wide(1), rest)
    return float(weights[held].sum() / weights.sum())
