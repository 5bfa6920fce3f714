"""Hard cases: questions on which numerical methods break, each with an answer from elsewhere.

To add one: a function that yields an `Attempt` a method, and its `Case` in the tuple of its module below.
"""

from __future__ import annotations

from kinetics.trust.hardcases.case import Attempt, Case
from kinetics.trust.hardcases.input import INPUT
from kinetics.trust.hardcases.passages import PASSAGES
from kinetics.trust.hardcases.sampling import SAMPLING
from kinetics.trust.hardcases.stiffness import STIFFNESS

CASES: tuple[Case, ...] = (*STIFFNESS, *PASSAGES, *SAMPLING, *INPUT)

__all__ = ["CASES", "Attempt", "Case"]
