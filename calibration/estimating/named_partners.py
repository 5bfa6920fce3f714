"""Whom the record of a break names, for all likelihoods of who broke what."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinetics.runs import BY_SEVERAL, BY_UNKNOWN, BY_WALL
from kinetics.support.arrays import Floats, Ints


def may_have_broken(recorded: Ints, column: Ints, wall: int | None, columns: int) -> NDArray[np.bool_]:
    """The columns (n, columns) that each record allows.

    recorded : (n,) species, or BY_WALL, BY_SEVERAL, BY_UNKNOWN; other records allow none
    column : (S,) column of each species
    wall : column of the wall; None if there is none

    Walls alone are recorded as the wall, so of several one at least is a body: all columns but the wall's. That they
    are shared out among all bodies as the model has it is right where a break by any body is as often one of several.
    """
    places = np.arange(columns)
    own = np.where(recorded >= 0, column[np.maximum(recorded, 0)], -1)
    named = own[:, None] == places
    is_wall = np.zeros(columns, dtype=bool) if wall is None else places == wall
    by = recorded[:, None]
    return np.asarray(named | ((by == BY_WALL) & is_wall) | ((by == BY_SEVERAL) & ~is_wall) | (by == BY_UNKNOWN))


def of_the_named(at_events: Floats, named: NDArray[np.bool_]) -> Floats:
    """The parts (n, C) at the events of the partners recorded; all parts if the recorded partners are gone.

    Of two breaks at one blow the second comes after the first has changed the state. A record that names nobody of
    these columns, as the wall beside a model without walls, leaves none.
    """
    parts = np.where(named, at_events, 0.0)
    are_gone = np.asarray(named.any(axis=1) & ~(parts > 0).any(axis=1))
    return np.where(are_gone[:, None], at_events, parts)
