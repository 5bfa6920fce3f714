"""The base of all checks of a sampler; to add one, follow the steps in `SamplerCheck`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

from kinetics.trust.verification.sampler_runs import SamplerRuns


@dataclass(frozen=True)
class SamplerFinding:
    """One figure of the runs with its exact value.

    p_value : largest probability with which a right sampler comes out as far away
    level : the finding fails at this p-value or below; 0 until `verify` has shared out the false alarms
    check : name of the check that made it

    >>> from kinetics.trust.verification import SamplerFinding
    >>> SamplerFinding("mean of A", found=12.4, expected=12.0, p_value=1e-9, level=1e-8).failed
    True
    """

    what: str
    found: float
    expected: float
    p_value: float
    level: float = 0.0
    check: str = ""

    @property
    def failed(self) -> bool:
        """Whether this is no chance."""
        return self.p_value <= self.level


class SamplerCheck(ABC):
    """A statistical check of a sampler's runs against the exact reference.

    To add one:

    1. In a file of its own, write a class that inherits from this one, with a `name` for reports, and in `sees` what
       kind of mistake it is for, as a phrase.
    2. Write `findings`. Every p-value must be exact or a proven upper bound, at any number of runs, with the
       reference's error allowed for. How many findings there are must not depend on what the runs show: what cannot be
       judged has p-value 1.
    3. Import it in `kinetics.trust.verification.checks`. Report, JSON and the contract in
       tests/contracts/test_sampler_checks.py read the tuple made there.
    4. If no mutant in `kinetics.trust.verification.mutants` makes the mistake that it is for, add one.

    `verify` gives every check an equal share of the false alarms, and every finding an equal share of its check's.

    >>> from kinetics.trust.verification import SAMPLER_CHECKS
    >>> [check.name for check in SAMPLER_CHECKS]
    ['each time', 'transitions', 'rates', 'repeated runs', 'correlated runs', 'waits', 'choices', 'paths agree']
    """

    name: ClassVar[str]
    sees: ClassVar[str]

    @abstractmethod
    def findings(self, sample: SamplerRuns) -> Iterable[SamplerFinding]:
        """All that was looked at."""
