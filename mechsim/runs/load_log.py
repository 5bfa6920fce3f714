"""The log of hits on structures that a run's record keeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kinetics.assembly import Structure
from kinetics.runs import BY_WALL
from mechsim.effects.hits import Hit

SHARED, BROKE = 1, 2  # flags of a hit, bits: several bodies or walls touched at once; the bond broke


@dataclass
class _Row:
    step: int
    time: float
    hit: Hit


class LoadLog:
    """Hits on structures, one row a collision.

    A collision may last several steps: hits on the same body (slot and birth) by the same partner in consecutive steps
    are one row, that of the largest load. A bond that breaks ends its collision, with the largest load.
    """

    def __init__(self) -> None:
        self.rows: list[_Row] = []
        self._last: dict[tuple[int, float, int], tuple[int, _Row]] = {}  # of a collision, its last step and its row

    def add(self, step: int, time: float, hit: Hit) -> None:
        """Take a hit of this step; steps never go back."""
        who = hit.slot, hit.born, hit.partner_slot
        last, row = self._last.get(who, (-2, None))
        if row is None or last < step - 1:
            self._last = {w: seen for w, seen in self._last.items() if seen[0] >= step - 1}
            row = _Row(step, time, hit)
            self.rows.append(row)
        elif hit.load > row.hit.load:
            row.step, row.time, row.hit = step, time, hit
        self._last[who] = step, row

    def arrays(
        self, channel: Callable[[Structure, tuple[int, int]], int], species: Callable[[Structure], int]
    ) -> dict[str, np.ndarray]:
        """The arrays that a record keeps, (H,) each, in the order in which the collisions began.

        channel : of the break of a bond of a structure; species : of a structure
        """
        hits = [row.hit for row in self.rows]
        return {
            "load_time": np.array([row.time for row in self.rows], np.float64),
            "load_channel": np.array([channel(hit.struck, hit.bond) for hit in hits], np.int16),
            "load_partner": np.array([BY_WALL if h.partner is None else species(h.partner) for h in hits], np.int16),
            "load_value": np.array([hit.load for hit in hits], np.float32),
            "load_flags": np.array([SHARED * h.is_shared + BROKE * h.breaks for h in hits], np.uint8),
        }
