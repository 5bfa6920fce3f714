"""The likelihood of channels whose propensities share the weights of a mixture, with the coefficients at their best.

Channel c has propensity b_c * sum over parts p of w_p h_cp. Given the weights, b_c is n_c / (E_c w), so that what is
left depends on the weights alone: sum over events of log(h w) - sum over channels of n_c log(E_c w), up to a constant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import special

MOST_LOGARITHMS = 2**22  # held at once, 32 MB


@dataclass(frozen=True, eq=False)
class MixedEvidence:
    """The evidence of paths on all channels of a model with one term and a mixture.

    at_events : (n, P) parts at the events, per unit of the coefficient, events with equal parts once
    copies : (n,) how many events have these
    exposure : (R', P) integrals of the parts over the time that each channel was open
    events : (R',) firings of each channel; not whole where those of channels with several constants are shared out
    """

    at_events: Floats
    copies: Ints
    exposure: Floats
    events: Floats

    def mle(self, weights: Floats, held: tuple[int, float] | None = None) -> Floats:
        """Largest log-likelihood (...) at weights (..., P); of `held`, position and value, a coefficient is given.

        Exact; -inf if an event that happened could not. Cost: a logarithm an event and set of weights.
        """
        rows = np.atleast_2d(weights)
        at_most = max(1, MOST_LOGARITHMS // max(len(self.at_events), 1))
        blocks = [rows[i : i + at_most] for i in range(0, len(rows), at_most)]
        with np.errstate(divide="ignore"):
            logs = np.concatenate([np.log(block @ self.at_events.T) @ self.copies for block in blocks])
            exposure = rows @ self.exposure.T
            best = special.xlogy(self.events, self.events) - self.events - special.xlogy(self.events, exposure)
            if held is not None:
                i, value = held
                best[:, i] = special.xlogy(self.events[i], value) - value * exposure[:, i]
        # Where an event could not happen the first sum is -inf, whatever the second one is.
        found = np.where(np.isneginf(logs), -np.inf, logs + best.sum(axis=1))
        return found.reshape(np.shape(weights)[:-1])
