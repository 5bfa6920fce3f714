"""Checks of the parts of a chain: rates, start, variables, labels, rewards, and the edge of a truncated one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.transient import Transitions
from kinetics.network.predicates import DEADLOCK, INIT, StateNames
from kinetics.support.arrays import Floats, integers, read_only, real_number, reals, whole_number
from kinetics.support.packages import sparse

if TYPE_CHECKING:
    from scipy.sparse import csr_array

ROUNDED = 1e-9  # relative to the exit rate: by which a row of a generator may miss 0
LARGEST = 1e300  # exit rate, 1/tu: sums of more are beyond what numbers hold
LEAST_REWARD = 1e-200  # so that a reward in a short time does not fall below what numbers hold
NORMED = 1e-9  # by which a distribution may miss 1; it is then scaled
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Reward:
    """A reward: `rates` (N,) a time unit in each state, `impulses` (N, N), sparse, at each jump.

    None is negative; either may be None, for nothing.

    most : largest rate at which it accumulates where the chain is truncated, impulses included; None if unknown
    error : relative, of `rates` and `impulses`

    >>> from kinetics import Chain, Reward
    >>> costs = Reward(rates=[0.0, 5.0], impulses=[[0.0, 20.0], [0.0, 0.0]])  # 5 a time unit down, 20 a failure
    >>> pump = Chain([[0.0, 0.1], [2.0, 0.0]], initial=0, rewards={"costs": costs})
    >>> round(pump.reward("costs", stationary=True).value, 6)  # (2 * 20 * 0.1 + 0.1 * 5) / 2.1
    2.142857
    """

    rates: ArrayLike | None = None
    impulses: Any = None
    most: float | None = None
    error: float = 0.0


def checked_parts(given: Mapping[str, Any]) -> dict[str, Any]:
    """The parts of a `Chain` by name, as arrays that belong together; a ValueError if they do not.

    Conditions of labels may name variables, that of the truncated states labels too, and formulas of rewards both. A
    label with the name of a variable says that this is boolean, and has its values.
    """
    known, variables = given["transitions"], tuple(given["variables"])
    if not isinstance(known, Transitions):
        known = _transitions_of(known)
    n, edge = known.size, given["truncated"]
    counts = None if given["counts"] is None else integers("counts", given["counts"], (n, len(variables)))
    if counts is None and variables:
        raise ValueError(f"variables {', '.join(variables)} came without counts; give their values in every state")
    checked_names(given["labels"], "label", {})
    checked_names(given["rewards"], "reward", {})
    initial = checked_start(given["initial"], n)
    truncated = np.zeros(n, dtype=bool) if edge is None or isinstance(edge, str) else checked_mask("truncated", edge, n)
    names = StateNames(n, variables, counts, built_in(known, initial, truncated, variables))
    labels = {name: states_of(names, target, f"label {name!r}") for name, target in given["labels"].items()}
    _check_booleans(labels, variables, counts)
    names.labels = {**names.labels, **labels}
    if isinstance(edge, str):
        truncated = names.holds(edge)
        names.labels = {**built_in(known, initial, truncated, variables), **labels}
    return {
        "transitions": known.stopped(truncated) if truncated.any() else known,
        "initial": initial,
        "labels": labels,
        "rewards": {name: _reward(names, name, reward) for name, reward in given["rewards"].items()},
        "variables": variables,
        "counts": counts,
        "truncated": read_only(truncated),
    }


def _check_booleans(labels: Mapping[str, Mask], variables: Sequence[str], counts: Any) -> None:
    """A ValueError if a label has the name of a variable, but not its values, as that of a boolean one has."""
    for name in labels:
        if name in variables and not np.array_equal(labels[name], counts[:, variables.index(name)]):
            raise ValueError(f"{name!r} is both a label and a variable with other values; rename one")


def built_in(known: Transitions, initial: Floats, truncated: Mask, taken: Sequence[str] = ()) -> dict[str, Mask]:
    """The labels of every chain, but for names that are taken: where it starts, and where no rate leads on."""
    stuck = np.bincount(known.rows[known.rates > 0], minlength=known.size) == 0
    found = {INIT: initial > 0, DEADLOCK: stuck & ~truncated}  # what lies beyond the edge is not known
    return {name: mask for name, mask in found.items() if name not in taken}


def states_of(names: StateNames, target: str | ArrayLike, what: str) -> Mask:
    """The states (N,) of a condition, or of truths (N,)."""
    return names.holds(target) if isinstance(target, str) else checked_mask(what, target, names.n_states)


def _reward(names: StateNames, name: str, given: Reward | ArrayLike | str) -> Reward:
    if isinstance(given, Reward):
        return checked_reward(name, given, names.n_states)
    rates, error = names.values(given) if isinstance(given, str) else (given, 0.0)
    return checked_reward(name, Reward(rates, error=error), names.n_states)


def _transitions_of(generator: Any) -> Transitions:
    """The rates of a generator, which are exact as given."""
    rates = checked_rates(generator)
    entries = rates.tocoo()
    ends = entries.row.astype(np.int64), entries.col.astype(np.int64)
    return Transitions(*ends, entries.data, np.zeros(rates.shape[0]), rate_error=0.0)


def checked_rates(generator: Any) -> csr_array:
    """The rates off the diagonal (N, N) of a generator, or as they are; a ValueError if they are none.

    It is taken for a generator where its diagonal holds anything: its rows must then sum to zero.
    """
    matrix = square("generator", generator)
    diagonal = matrix.diagonal()
    rates = _off_diagonal(matrix)
    is_sparse = sparse.issparse(generator)
    entries: Any = sparse.coo_array(generator) if is_sparse else rates.tocoo()  # each on its own
    least = np.where(entries.row == entries.col, 0.0, entries.data)
    if least.min(initial=0.0) < 0:
        at = int(np.argmin(least))
        raise ValueError(
            f"the rate from state {entries.row[at]} to state {entries.col[at]} is {entries.data[at]:g}; expected at "
            f"least 0"
        )
    with np.errstate(over="ignore"):
        largest = float(rates.sum(axis=1).max())
    if not largest <= LARGEST:
        raise ValueError(
            f"a state has an exit rate of {largest:g} 1/tu; the largest allowed is {LARGEST:g}: choose "
            f"a shorter time unit"
        )
    if diagonal.any():
        exits = np.asarray(rates.sum(axis=1)).ravel()
        off = np.abs(exits + diagonal) > ROUNDED * np.maximum(exits, np.abs(diagonal))
        if off.any():
            row = int(np.argmax(off))
            raise ValueError(
                f"row {row} of the generator sums to {exits[row] + diagonal[row]:g}; expected 0, with minus the exit "
                f"rate {exits[row]:g} on the diagonal, or no diagonal at all"
            )
    return rates


def square(name: str, given: Any, n: int | None = None) -> csr_array:
    """A sparse or dense matrix (n, n) of finite numbers, as a csr_array without zeros and duplicates."""
    if not sparse.issparse(given):
        given = reals(name, given, (None, None))
    if np.iscomplexobj(given):
        raise ValueError(f"{name} holds complex numbers; expected real ones")
    matrix = sparse.csr_array(given, dtype=np.float64, copy=True)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or n not in (None, matrix.shape[0]):
        wanted = "a square" if n is None else f"({n}, {n})"
        raise ValueError(f"{name} has shape {matrix.shape}; expected {wanted}")
    matrix.sum_duplicates()
    bad = matrix.data[~np.isfinite(matrix.data)]
    if bad.size:
        raise ValueError(f"{name} holds {bad[0]}; expected finite numbers")
    if not matrix.shape[0]:
        raise ValueError(f"{name} has no states; expected one at least")
    matrix.eliminate_zeros()
    return matrix


def checked_start(initial: ArrayLike, n: int) -> Floats:
    """Probabilities (N,) at time 0, from these or from the number of one state."""
    if np.ndim(initial) == 0:
        state = whole_number("initial", initial, 0)  # type: ignore[arg-type]
        if state >= n:
            raise ValueError(f"initial state {state}; expected 0 to {n - 1}")
        return read_only(np.eye(1, n, state)[0])
    start = reals("initial", initial, (n,), minimum=0)
    total = float(start.sum())
    if abs(total - 1.0) > NORMED:
        raise ValueError(f"initial sums to {total:.12g}; expected probabilities that sum to 1")
    return read_only(start / total)


def checked_mask(name: str, given: Any, n: int) -> NDArray[np.bool_]:
    """Truths (N,), one a state."""
    mask = np.asarray(given)
    if mask.dtype != np.bool_ or mask.shape != (n,):
        raise ValueError(f"{name} is {mask.dtype} of shape {mask.shape}; expected one truth a state, ({n},)")
    return read_only(mask.copy())


def checked_names(names: Mapping[str, Any], what: str, taken: Mapping[str, Any]) -> None:
    """A ValueError if a name is no text, empty, or that of a variable."""
    for name in names:
        if not isinstance(name, str) or not name or '"' in name:
            raise ValueError(f"{name!r} is no name of a {what}; expected text without quotes")
        if name in taken:
            raise ValueError(f"{name!r} is both a {what} and a variable; rename one")


def checked_reward(name: str, given: Reward, n: int) -> Reward:
    """A reward with its parts as arrays, none negative."""
    rates = np.zeros(n) if given.rates is None else reals(f"reward {name!r}", given.rates, (n,))
    impulses = None if given.impulses is None else square(f"impulses of reward {name!r}", given.impulses, n)
    least = min(rates.min(), 0.0 if impulses is None or not impulses.nnz else impulses.data.min())
    if least < 0:
        raise ValueError(
            f"reward {name!r} holds {least:g}; expected at least 0: ask for gains and losses as two rewards"
        )
    held = np.concatenate([rates, [] if impulses is None else impulses.data])
    tiny = held[(held > 0.0) & (held < LEAST_REWARD)]
    if tiny.size:
        raise ValueError(f"reward {name!r} holds {tiny[0]:g}; expected 0 or {LEAST_REWARD:g} at least: change its unit")
    most = None if given.most is None else real_number(f"most of reward {name!r}", given.most)
    if most is not None and not 0.0 <= most < np.inf:
        raise ValueError(f"most of reward {name!r} is {most}; expected a finite number of at least 0")
    error = real_number(f"error of reward {name!r}", given.error)
    if not 0.0 <= error < 1.0:
        raise ValueError(f"error of reward {name!r} is {error}; expected a share from 0 to 1")
    return Reward(rates, impulses, most, error)


def _off_diagonal(matrix: csr_array) -> csr_array:

    entries = matrix.tocoo()
    off = entries.row != entries.col
    return sparse.csr_array((entries.data[off], (entries.row[off], entries.col[off])), shape=matrix.shape)
