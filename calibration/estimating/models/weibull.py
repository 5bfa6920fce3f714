"""The Weibull model of rates: they rise or fall with the time since the start or the last restart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.estimating.rate_model import RateModel
from kinetics.rates.breaks import ShapeParameter
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class Weibull(RateModel):
    """Propensity k N h(s) kappa a^(kappa - 1) at age a: Weibull waiting times in runs restarted after each event.

    kappa > 1: slow at first, as in a tank whose bodies must first meet; kappa < 1: fast at first, as where the pieces
    of a broken bond still lie side by side. With kappa = 1 this is mass action, so the likelihood-ratio test between
    the two asks whether waits are exponential. k is in tu^-kappa. In a run without restarts it is a power-law drift
    (Crow 1974).

    >>> import numpy as np
    >>> from calibration import Weibull, fit_rates
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> waits = np.random.default_rng(1).weibull(2.0, size=200)
    >>> fit = fit_rates(Weibull(), [JumpPath(decay, {"A": 1}, [wait], [0], end=wait) for wait in waits])
    >>> low, high = fit.interval("kappa")
    >>> low < 2.0 < high, high - low < 0.5
    (True, True)
    """

    kappa: float = 1.0

    name = "weibull"
    shape = (ShapeParameter("kappa", 0.2, 5.0),)

    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """Combinations of reactants, as under mass action."""
        return [path.network.combinations_of(path.states)]

    def speed(self, age: Floats) -> Floats:
        """The factor kappa a^(kappa - 1)."""
        if (age <= 0).any():
            raise ValueError("an event at age 0, where the Weibull hazard is 0 or infinite; leave that run out")
        return np.asarray(self.kappa * age ** (self.kappa - 1))

    def elapsed(self, begin: Floats, end: Floats, origin: Floats) -> Floats:
        """The increase of a^kappa from beginning to end."""
        return np.asarray((end - origin) ** self.kappa - (begin - origin) ** self.kappa)
