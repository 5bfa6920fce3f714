"""Hard cases: problems on which numerical methods fail, each with an answer from an independent source.

To add one, write a function that yields one `Attempt` per method, and put its `Case` in the tuple of its module.
"""

from __future__ import annotations

from kinetics.trust.hardcases.cancellation import CANCELLATION
from kinetics.trust.hardcases.case import Attempt, Case
from kinetics.trust.hardcases.chains import CHAINS
from kinetics.trust.hardcases.input import INPUT
from kinetics.trust.hardcases.passages import PASSAGES
from kinetics.trust.hardcases.sampling import SAMPLING
from kinetics.trust.hardcases.stiffness import STIFFNESS

CASES: tuple[Case, ...] = (*STIFFNESS, *CANCELLATION, *PASSAGES, *SAMPLING, *CHAINS, *INPUT)

__all__ = ["CASES", "Attempt", "Case"]
