"""The posterior of the parameters of a rates file, and the rate constants that go with them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network import Network
from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.breaks import Expansion
from kinetics.support.arrays import Floats
from kinetics.support.intervals import jeffreys_posterior, posterior_draws


@dataclass(frozen=True, eq=False)
class RatesPosterior:
    """What is known of P parameters: the rates of R channels, then the shape parameters of the break model.

    expansion : the network in which breaks have partners
    breaks : the break model, and the posterior of its shape
    rates : (R,) point rates, 1/tu
    events, exposure : evidence of each channel; None where there is none, so that the rate is taken as known
    exposures : exposures of each break to the partners; None where they are not known
    scales : (R',) factors on the rate constants, from the tank of the measurement to that of the use

    Each rate comes from Gamma(events + 1/2, exposure), its posterior under Jeffreys' prior, with the exposure at the
    shape of largest likelihood. At another shape the same rate stands for the coefficient by which as many breaks would
    have been expected, so rates and shape are independent in the posterior.

    >>> from kinetics import ChannelRate, Convention, Network, Rates
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> measured = ChannelRate(rate=0.02, events=2, exposure=100.0, ways=1)
    >>> rates = Rates(convention=Convention(combinations="distinct"), channels={"decay": measured})
    >>> posterior = rates.posterior(decay)
    >>> posterior.names, posterior.mean.tolist(), posterior.covariance.round(9).tolist()  # 2.5 / 100, and 2.5 / 100^2
    (('decay',), [0.025], [[0.00025]])
    """

    expansion: Expansion
    breaks: BreakTerms
    rates: tuple[float, ...]
    events: tuple[float | None, ...]
    exposure: tuple[float | None, ...]
    exposures: tuple[tuple[float, ...] | None, ...]
    scales: Floats

    @property
    def names(self) -> tuple[str, ...]:
        """Names (P,) of the parameters."""
        return (*self.rate_names, *self.breaks.shape)

    @property
    def rate_names(self) -> tuple[str, ...]:
        """Names of the rates: of their channels."""
        return self.expansion.base.channels

    def coefficients(self, rates: Floats) -> Floats:
        """Coefficients (n, R) of the channels, from rates (n, R): the same."""
        return rates

    def parts(self, parameters: Floats) -> Floats:  # noqa: ARG002
        """The part (R, R') that each rate has in each rate constant at parameters (P,): all of its own channel's."""
        return (self.expansion.base_of == np.arange(len(self.rates))[:, None]).astype(float)

    def exposures_at(self, points: Floats) -> list[Floats | None]:
        """Exposure (G,) of each rate at shapes (G, K); None where it does not depend on them."""
        weights = self._weights_at(points)
        return [None if parts is None else weights @ np.array(parts) for parts in self.exposures]

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

    def to_arviz(self, draws: int = 1000, chains: int = 4, seed: int = 0) -> Any:
        """Independent draws as ArviZ's `InferenceData`; see `inference_data`."""
        from kinetics.rates.inference import inference_data

        return inference_data(self, draws, chains, seed)

    def constants(self, parameters: ArrayLike) -> Floats:
        """Rate constants (n, R'), 1/tu, that go with parameters (n, P)."""
        table = np.asarray(parameters, dtype=float)
        rates, shapes = np.split(table.copy(), [len(self.rates)], axis=1)
        points, which = np.unique(shapes, axis=0, return_inverse=True)
        rates *= self.factors_at(points)[which.ravel()]
        weights = self._weights_at(points)[which.ravel()]
        return self.expansion.constants(self.coefficients(rates), weights) * self.scales

    def factors_at(self, points: Floats) -> Floats:
        """What rates (G, R) are multiplied with at shapes (G, K), so that as many breaks are expected at each."""
        factors = np.ones((len(points), len(self.rates)))
        for r, (whole, at) in enumerate(zip(self.exposure, self.exposures_at(points), strict=True)):
            if at is not None and whole is not None:
                # the exposure that goes with this shape, where there is any
                np.divide(whole, at, out=factors[:, r], where=at > 0)
        return factors

    def _weights_at(self, points: Floats) -> Floats:
        """Weights (G, P') of the partners at shapes (G, K)."""
        base, model, names = self.expansion.base, self.breaks.break_model, self.breaks.shape
        return np.array([model.weights(base, dict(zip(names, point, strict=True))) for point in points.tolist()])

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
