"""The state in which a model starts: that of the variables, or the one that `init ... endinit` asks for."""

from __future__ import annotations

import numpy as np

from kinetics.markov.prism.system import System
from kinetics.markov.prism.terms import Term
from kinetics.markov.prism.tokens import ModelTextError
from kinetics.markov.prism.values import values_of
from kinetics.support.arrays import Ints

MOST_TRIED = 2_000_000  # values of some variables together


def start_of(system: System) -> Ints:
    """The values (V,) at time 0.

    ModelTextError: `init ... endinit` holds in several states or in none, or leaves too many to be tried

    >>> from kinetics.markov.prism.parsing import model_text
    >>> from kinetics.markov.prism.starting import start_of
    >>> from kinetics.markov.prism.resolving import system_of
    >>> text = "ctmc module m x : [0..9]; y : [0..9]; endmodule init x + y = 18 & x >= y endinit"
    >>> start_of(system_of(model_text(text), {})).tolist()
    [9, 9]
    """
    asked = system.start
    if asked is None:
        return system.starts
    found = _held(system, _conditions(asked), asked)
    if len(found) != 1:
        some = "; ".join(system.states(found).shown(row) for row in range(min(len(found), 3)))
        raise ModelTextError(
            f"init ... endinit holds in {len(found)} states{f' ({some}, ...)' if some else ''}; a chain starts in one: "
            f"add a first state that leads to them",
            asked.token,
        )
    return np.asarray(found[0])


def _held(system: System, conditions: list[Term], asked: Term) -> Ints:
    """All states (n, V) in which the conditions hold.

    Variables get their values one by one; each condition is judged as soon as all that it names have theirs.
    """
    order = sorted(range(len(system.names)), key=lambda place: _first_use(conditions, place))
    table, tried = system.ranges[np.newaxis, :, 0].copy(), set[int]()
    left = conditions
    for place in order:
        low, high = system.ranges[place].tolist()
        if len(table) * (high - low + 1) > MOST_TRIED:
            raise ModelTextError(
                f"init ... endinit leaves over {MOST_TRIED} states to be tried; give each variable a start instead",
                asked.token,
            )
        values = np.tile(np.arange(low, high + 1), len(table))
        table = np.repeat(table, high - low + 1, axis=0)
        table[:, place] = values
        tried.add(place)
        for condition in [each for each in left if _places(each) <= tried]:
            table = table[np.broadcast_to(values_of(condition, system.states(table)), (len(table),))]
        left = [each for each in left if not _places(each) <= tried]
    for condition in left:  # of no variable, if there are none
        table = table[np.broadcast_to(values_of(condition, system.states(table)), (len(table),))]
    return table


def _first_use(conditions: list[Term], place: int) -> tuple[int, int]:
    """A condition on few variables that names a variable, so that those which leave few values come first."""
    sizes = [(len(_places(each)), k) for k, each in enumerate(conditions) if place in _places(each)]
    return min(sizes, default=(len(conditions) + place + 10**6, 0))


def _conditions(term: Term) -> list[Term]:
    """The parts of a condition that must all hold."""
    return [each for part in term.parts for each in _conditions(part)] if term.operation == "&" else [term]


def _places(term: Term) -> set[int]:
    """The variables that a term names."""
    if term.operation == "variable":
        return {term.value}
    return {place for part in term.parts for place in _places(part)}
