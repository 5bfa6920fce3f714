"""Which channel fires, event by event: in shares of the propensities, given all that happened before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log

import numpy as np

from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats
from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.sampler_runs import EVENTS, SamplerRuns
from kinetics.trust.verification.tail_bounds import from_evidence

MOST_CHANNELS = 64
BETS = np.array([-0.9, -0.5, -0.1, -0.02, 0.02, 0.1, 0.5, 0.9])  # each keeps some of its money, whatever fires
ROUNDING = 1e-12  # of an event's factor, in doubles


class PathChoices(SamplerCheck):
    """Bets on each channel against its share of the propensity: their capital is an e-value.

    Product over events of 1 + bet * (fired - share), the mean over eight bets. Its expectation is at most 1 whenever a
    run ends (Ville 1939; Shafer 2021, doi:10.1111/rssa.12647). A sampler of counts alone has no paths.
    """

    name = "choices"
    sees = "channels that fire in wrong proportions, even if they change the counts in the same way"

    def findings(self, sample: SamplerRuns) -> Iterator[SamplerFinding]:
        """Yield findings of the paths of the seed, for every channel, or the first 64."""
        channels = sample.reference.network.channels[:MOST_CHANNELS]
        fired, expected, capital = _capital(sample.paths, len(channels))
        for r, channel in enumerate(channels):
            top = float(capital[:, r].max())
            evidence = top + log(float(np.exp(capital[:, r] - top).mean()))
            what = f"events of {channel}, given the states before"
            yield SamplerFinding(what, float(fired[r]), float(expected[r]), from_evidence(evidence))


def _capital(paths: Sequence[JumpPath], n_channels: int) -> tuple[Floats, Floats, Floats]:
    """Events of each channel (R,), their expected number (R,), and the log of each bet's capital (bets, R)."""
    fired, expected = np.zeros((2, n_channels))
    capital, left = np.zeros((BETS.size, n_channels)), EVENTS
    for path in paths:
        chosen = path.channels[:left]
        propensities = path.network.propensities(path.states[: chosen.size])
        shares = propensities[:, :n_channels] / propensities.sum(axis=1, keepdims=True)
        happened = (chosen[:, None] == np.arange(n_channels)).astype(float)
        fired, expected = fired + happened.sum(axis=0), expected + shares.sum(axis=0)
        capital += np.log1p(BETS[:, None, None] * (happened - shares)).sum(axis=1) - ROUNDING * chosen.size
        left -= chosen.size
    return fired, expected, capital
