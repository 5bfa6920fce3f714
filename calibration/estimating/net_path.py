"""Runs without the breaks that are undone at once: net breaks and net joins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Ints, integers


def net_path(path: JumpPath, bonds: Ints, window: float) -> JumpPath:
    """The run without each break whose two cubes bond again within a window, and without that join.

    bonds : (E, 2) the two cubes whose faces met or parted at each event, -1 if that is not known
    window : tu

    Rates of free-running runs count such a break as a break and as a join; those of net runs count neither, and take
    the structure to be whole meanwhile. A pair stays where the run would be impossible without it, because a piece had
    reacted in between. Cost: breaks that are undone, times events.

    ValueError: bonds of another shape, or a window that is not above 0.

    >>> from calibration import net_path
    >>> from kinetics import JumpPath, Network
    >>> pairs = Network.from_text("2 A <-> AA, 1, 1")
    >>> path = JumpPath(pairs, {"A": 2}, times=[1.0, 2.0, 2.1], channels=[0, 1, 0], end=3.0)  # joins, breaks, joins
    >>> net_path(path, bonds=[[0, 1]] * 3, window=0.5).times.tolist()
    [1.0]
    """
    if not window > 0:
        raise ValueError(f"window = {window}; expected a time above 0, tu")
    cubes = np.sort(integers("bonds", bonds, (path.times.size, 2), minimum=-1), axis=1)
    change = path.network.stoichiometry
    is_kept = np.ones(path.times.size, bool)
    fired = path.channels != RESTART
    breaks = np.flatnonzero(fired & (change[path.channels].sum(axis=1) > 0) & (cubes[:, 0] >= 0))
    for row in breaks[::-1]:  # the last first, for breaks of a piece that lie within
        last = int(np.searchsorted(path.times, path.times[row] + window, side="right"))
        for other in range(row + 1, last):
            if path.channels[other] == RESTART:
                break
            is_same = is_kept[other] and (cubes[other] == cubes[row]).all()
            if is_same and (change[path.channels[other]] == -change[path.channels[row]]).all():
                trial = is_kept.copy()
                trial[[row, other]] = False
                if _is_possible(path, trial):
                    is_kept = trial
                break
    return _kept(path, is_kept)


def _kept(path: JumpPath, is_kept: NDArray[np.bool_]) -> JumpPath:
    return replace(path, times=path.times[is_kept], channels=path.channels[is_kept])


def _is_possible(path: JumpPath, is_kept: NDArray[np.bool_]) -> bool:
    """Whether every event that is kept still finds its reactants; a path refuses to be made otherwise."""
    try:
        _kept(path, is_kept)
    except ValueError:
        return False
    return True
