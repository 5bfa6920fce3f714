"""The posterior of the parameters of a rates file, and the rate constants that go with them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from kinetics.breaks import Expansion
from kinetics.network import Network
from kinetics.rates.break_terms import BreakTerms
from kinetics.support.arrays import Floats
from kinetics.support.intervals import jeffreys_posterior, posterior_draws


@dataclass(frozen=True, eq=False)
class RatesPosterior:
    """What is known of P parameters: the rates of R channels, then the K shape parameters of the break model.

    expansion : the network in which breaks have partners
    breaks : the break model, and the posterior of its shape
    rates : (R,) point rates, 1/tu
    events, exposure : evidence of each channel; None where there is none, so that the rate is taken as known
    exposures : exposures of each break to the partners; None where they are not known
    scales : (R',) factors on the rate constants, from the tank of the measurement to that of the use

    Each rate comes from Gamma(events + 1/2, exposure), its posterior under Jeffreys' prior, with the exposure at the
    shape of largest likelihood. At another shape the same rate stands for the coefficient by which as many breaks would
    have been expected, so rates and shape are independent in the posterior.
    """

    expansion: Expansion
    breaks: BreakTerms
    rates: tuple[float, ...]
    events: tuple[int | None, ...]
    exposure: tuple[float | None, ...]
    exposures: tuple[tuple[float, ...] | None, ...]
    scales: Floats

    @property
    def names(self) -> tuple[str, ...]:
        """Names (P,) of the parameters."""
        return (*self.expansion.base.channels, *self.breaks.shape)

    @cached_property
    def mean(self) -> Floats:
        """Posterior means (P,); the value itself where a parameter is taken as known."""
        means = [self._gamma(r)[0] for r in range(len(self.rates))]
        return np.append(means, self._shapes[1] @ self._shapes[0])

    @cached_property
    def covariance(self) -> Floats:
        """Posterior covariances (P, P)."""
        shapes, weights = self._shapes
        off = shapes - weights @ shapes
        table = np.zeros((len(self.names), len(self.names)))
        n = len(self.rates)
        table[range(n), range(n)] = [self._gamma(r)[1] for r in range(n)]
        table[n:, n:] = off.T @ (weights[:, None] * off)
        return table

    def draw(self, rng: np.random.Generator, n: int) -> Floats:
        """Draws (n, P) of the parameters."""
        table = posterior_draws(rng, n, self.rates, self.events, self.exposure)
        shapes, weights = self._shapes
        if self.breaks.posterior is None:
            return np.hstack([table, np.tile(shapes, (n, 1))])
        return np.hstack([table, shapes[rng.choice(weights.size, size=n, p=weights)]])

    def constants(self, parameters: ArrayLike) -> Floats:
        """Rate constants (n, R'), 1/tu, that go with parameters (n, P)."""
        table = np.asarray(parameters, dtype=float)
        rates, shapes = np.split(table.copy(), [len(self.rates)], axis=1)
        points, which = np.unique(shapes, axis=0, return_inverse=True)
        base, model, names = self.expansion.base, self.breaks.break_model, self.breaks.shape
        by_point = np.array([model.weights(base, dict(zip(names, point, strict=True))) for point in points.tolist()])
        weights = by_point[which.ravel()]
        for r, (whole, parts) in enumerate(zip(self.exposure, self.exposures, strict=True)):
            if parts is not None and whole is not None:
                # the exposure that goes with this shape, where there is any
                exposure = weights @ np.array(parts)
                rates[:, r] *= np.divide(whole, exposure, out=np.ones(len(rates)), where=exposure > 0)
        return self.expansion.constants(rates, weights) * self.scales

    def expected_constants(self) -> Floats:
        """Posterior means (R',) of the rate constants, 1/tu, in closed form.

        Given the shape, constants are linear in the rates, which do not depend on it: means over the grid of shapes.
        """
        shapes, weights = self._shapes
        means = np.tile(self.mean[: len(self.rates)], (len(shapes), 1))
        return np.asarray(weights @ self.constants(np.hstack([means, shapes])))

    @cached_property
    def expected(self) -> Network:
        """The network at the posterior mean of each rate constant."""
        return self.expansion.network.with_rates(self.expected_constants())

    @property
    def _shapes(self) -> tuple[Floats, Floats]:
        """Shapes (G, K) and their probabilities (G,)."""
        posterior = self.breaks.posterior
        if posterior is None:
            return np.array([list(self.breaks.shape.values())], dtype=float), np.ones(1)
        weights = np.array(posterior.weights)
        return np.array(posterior.points), weights / weights.sum()

    def _gamma(self, r: int) -> tuple[float, float]:
        """Posterior mean and variance of one rate."""
        events, exposure = self.events[r], self.exposure[r]
        if events is None or exposure is None:
            return self.rates[r], 0.0
        shape, total = jeffreys_posterior(events, exposure)
        return shape / total, shape / total**2
