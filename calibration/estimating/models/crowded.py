"""The crowded model of rates: every other body in the tank adds to the rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.estimating.rate_model import RateModel
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class Crowded(RateModel):
    """Propensity N h(s) (k + c * others), where `others` counts the bodies in the tank besides the reactants.

    With c = 0 this is mass action, so the likelihood-ratio test between the two asks whether a rate depends on the
    crowd, as it does where collisions with others break bonds. The runs must differ in their numbers of bodies: with
    one number alone, only k + c * others is known, and the intervals of k and c begin at 0.

    >>> from calibration import Crowded
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> path = JumpPath(decay, {"A": 3}, times=[0.5], channels=[0], end=3.0)
    >>> [part[:, 0].tolist() for part in Crowded().combinations(path)]  # h, and h times the others, before and after
    [[3.0, 2.0], [6.0, 2.0]]
    """

    name = "crowded"
    terms = ("k", "c")

    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """Combinations of reactants, then the same times the number of other bodies."""
        h = path.network.combinations_of(path.states)
        needed = path.network.sparse_reactants
        taken = np.zeros(needed.shape[0], dtype=np.int64)
        np.add.at(taken, needed.rows, needed.copies)
        others = path.states.sum(axis=1)[:, None] - taken
        return [h, h * np.maximum(others, 0)]
