"""All transitions out of many states at once: guards, rates and new values as arrays over states.

An action's combinations are built module by module: each transition of the modules before, once for every branch of an
enabled command of the next one. So work grows with the transitions that there are, not with all combinations of
commands.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.prism.system import Branch, Command, SharedAction, System
from kinetics.markov.prism.terms import Term
from kinetics.markov.prism.values import States, bounds_of, values_of
from kinetics.support.arrays import Floats, Ints

ROUNDING = 2.0**-53
LOST = 1e-6  # relative error of a rate or reward beyond which it is refused
LEAST, LARGEST = 1e-290, 1e290  # of a rate: products of others might lose their digits, or overflow


class Moves(NamedTuple):
    """K transitions out of n states.

    rows : (K,) from which state; targets (K, V) : to which values
    rates : (K,) 1/tu, above 0
    actions : (K,) number of the action
    roundings : (K,) bounds on the relative errors of the rates, in 2**-53
    """

    rows: Ints
    targets: Ints
    rates: Floats
    actions: Ints
    roundings: Floats

    def picked(self, chosen: NDArray[np.bool_] | Ints) -> Moves:
        """Some of them."""
        rows, targets, rates, actions, roundings = self
        return Moves(rows[chosen], targets[chosen], rates[chosen], actions[chosen], roundings[chosen])


def joined(parts: list[Moves], n_variables: int) -> Moves:
    """Moves of several parts as one."""
    whole = np.empty(0, dtype=np.int64)
    none = Moves(whole, np.empty((0, n_variables), dtype=np.int64), np.empty(0), whole, np.empty(0))
    return Moves(*(np.concatenate(arrays) for arrays in zip(none, *parts, strict=True)))


def moves_of(system: System, table: Ints, failed: NDArray[np.bool_] | None = None) -> Moves:
    """All transitions out of states (n, V).

    failed : (n,) of states that may never be reached: what is wrong in one of them is only noted here
    ModelTextError: in one of them something has no value, a rate is negative or not finite, or a new value is out of
    its range

    >>> import numpy as np
    >>> from kinetics.markov.prism.moves import moves_of
    >>> from kinetics.markov.prism.parsing import model_text
    >>> from kinetics.markov.prism.resolving import system_of
    >>> pump = model_text("ctmc module pump up : [0..3] init 3; [] up > 0 -> 0.1 * up : (up'=up-1); endmodule")
    >>> moves = moves_of(system_of(pump, {}), np.array([[3], [0], [1]]))
    >>> moves.rows.tolist(), moves.targets.tolist(), moves.rates.round(3).tolist()
    ([0, 2], [[2], [0]], [0.3, 0.1])
    """
    states = system.states(table, failed)
    found = [part for k, action in enumerate(system.actions) for part in _of_action(system, states, k, action)]
    return joined(found, table.shape[1])


def _of_action(system: System, states: States, number: int, action: SharedAction) -> Iterator[Moves]:
    """The transitions by one action, in parts."""
    guards = [[_holds(command, states) for command in commands] for commands in action.parts]
    if not all(guards):
        return
    ready = np.logical_and.reduce([np.logical_or.reduce(each) for each in guards])
    rows = np.flatnonzero(ready)
    if not rows.size:
        return
    ones, zeros = np.ones(rows.size), np.zeros(rows.size)
    parts = [Moves(rows, states.table[rows], ones, np.full(rows.size, number), zeros)]
    for commands, masks in zip(action.parts, guards, strict=True):
        before = joined(parts, states.table.shape[1]) if len(parts) > 1 else parts[0]
        parts = [
            after
            for command, mask in zip(commands, masks, strict=True)
            for branch in command.branches
            for after in _after(system, states, before, mask & ready, branch)
        ]
        if not parts:
            return
    yield from parts


def _holds(command: Command, states: States) -> NDArray[np.bool_]:
    return np.broadcast_to(values_of(command.guard, states), (len(states),))


def _after(system: System, states: States, before: Moves, mask: NDArray[np.bool_], branch: Branch) -> Iterator[Moves]:
    """The moves before, where a command is enabled (n,), with what a branch of it adds; nothing where its rate is 0."""
    enabled = np.flatnonzero(mask)
    if not enabled.size:
        return
    here = states if enabled.size == len(states) else states.picked(enabled)
    rates, lost = (np.ones(enabled.size), 0.0) if branch.rate is None else rates_of(branch.rate, here, "a rate")
    goes = rates > 0.0
    if not goes.any():
        return
    if not goes.all():
        here, enabled, rates = here.picked(goes), enabled[goes], rates[goes]
    place = np.full(len(states), -1)
    place[enabled] = np.arange(enabled.size)
    if branch.rate is not None:
        _check_sizes(rates, branch.rate, here)
    chosen = before.picked(place[before.rows] >= 0)
    among = place[chosen.rows]
    for variable, term in branch.changes:
        chosen.targets[:, variable] = _assigned(system, here, variable, term)[among]
    product = chosen.rates * rates[among]
    rounds = (chosen.rates != 1.0) & (rates[among] != 1.0)  # a product with 1 is exact
    yield chosen._replace(rates=product, roundings=1.0001 * (chosen.roundings + lost + rounds))


def rates_of(term: Term, states: States, what: str) -> tuple[Floats, float]:
    """Values (n,) of a rate or reward, none negative, and a bound on their relative errors, in roundings of 2**-53.

    ModelTextError: one is negative, not finite, or loses its digits
    """
    n = len(states)
    found = np.broadcast_to(values_of(term, states), (n,)).astype(np.float64)
    states.refuse(~np.isfinite(found), term, f"{what} is not finite")
    states.refuse(found < 0.0, term, f"{what} is negative ({found.min(initial=0.0):g}); expected at least 0")
    low, high = (np.broadcast_to(end, (n,)) for end in bounds_of(term, states))
    known = np.clip(found, low, high)
    with np.errstate(all="ignore"):
        lost = np.where(low == high, 0.0, (high - low) / np.where(low > 0.0, low, 0.0))
    lost = np.where(np.isnan(lost), np.inf, lost)
    states.refuse(lost > LOST, term, f"{what} loses its digits, because large terms cancel; write it without")
    return known, 1.0001 * float(lost.max(initial=0.0)) / ROUNDING


def _check_sizes(rates: Floats, term: Term, states: States) -> None:
    wrong = (rates < LEAST) | (rates > LARGEST)
    states.refuse(wrong, term, f"a rate is below {LEAST:g} or above {LARGEST:g}; choose another unit of time")


def _assigned(system: System, states: States, variable: int, term: Term) -> Ints:
    """New values (n,) of a variable, within its range."""
    found = np.broadcast_to(values_of(term, states), (len(states),))
    low, high = system.ranges[variable].tolist()
    outside = ~((found >= low) & (found <= high))
    if outside.any():
        name, value = system.names[variable], float(found[np.argmax(outside)])
        states.refuse(outside, term, f"{name!r} is assigned {value:.17g}; its range is {low} to {high}", shows=True)
    return np.where(outside, low, found).astype(np.int64)
