"""The mass-action model of rates: one rate constant per channel, whatever else is in the tank."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from calibration.estimating.exposure import meetings
from calibration.estimating.rate_model import RateModel
from kinetics.network import Tank
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class MassActionRates(RateModel):
    """Propensity k N h(s), h the combinations of reactants by the network's convention (Gillespie 1977).

    The estimate is events over exposure; `estimate` gives it in closed form, with exact intervals and as a rates table.
    Other models are tested against this one: choose it unless the likelihood-ratio test or held-out runs refute it.

    tank : where the constants hold, to which runs in other tanks are scaled; None: runs are taken as they are

    >>> from calibration import MassActionRates, fit_rates
    >>> from kinetics import JumpPath, Network
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> path = JumpPath(decay, {"A": 2}, times=[0.5, 1.5], channels=[0, 0], end=3.0)
    >>> fit_rates(MassActionRates(), [path]).parameters
    {'k decay': 1.0}
    """

    tank: Tank | None = None

    name = "mass-action"

    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """Distinct combinations of reactants, or whichever convention the network has."""
        h = path.network.combinations_of(path.states)
        return [h if self.tank in (None, path.tank) else h * meetings(path.network, path.tank, self.tank)]
