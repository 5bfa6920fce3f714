"""Questions on which numerical methods break, each with an answer from elsewhere.

To add one: a function that yields an `Attempt` a method, and its `Case` in the tuple of its module below.
"""

from __future__ import annotations

from kinetics.hardcases.case import Attempt, Case
from kinetics.hardcases.input import INPUT
from kinetics.hardcases.passages import PASSAGES
from kinetics.hardcases.sampling import SAMPLING
from kinetics.hardcases.stiffness import STIFFNESS

CASES: tuple[Case, ...] = (*STIFFNESS, *PASSAGES, *SAMPLING, *INPUT)

__all__ = ["CASES", "Attempt", "Case"]
