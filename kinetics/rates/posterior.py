"""The posterior of the parameters of a rates file, and the rate constants that go with them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network import Network
from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.breaks import Expansion
from kinetics.rates.inference import inference_data
from kinetics.rates.measured import MeasuredRate
from kinetics.support.arrays import Floats, divided
from kinetics.support.intervals import jeffreys_posterior, posterior_draws

STEP = 1e-3  # of a shape parameter, for what it does to the rate constants: a closed form, whose differences are cheap
TINY = 1e-200  # of the largest rate constant: takes the place of one that is 0 and changes with the shape


class Posterior(ABC):
    """What is known of P parameters, and the networks that go with them.

    names : of the parameters
    """

    names: tuple[str, ...]

    @property
    @abstractmethod
    def expected(self) -> Network:
        """The network at the posterior mean of each rate constant."""

    @property
    @abstractmethod
    def is_rate(self) -> Any:
        """Whether each parameter (P,) is a rate, so that it is above 0 and predictions have an elasticity by it."""

    @property
    @abstractmethod
    def mean(self) -> Floats:
        """Posterior means (P,)."""

    @property
    @abstractmethod
    def covariance(self) -> Floats:
        """Posterior covariances (P, P)."""

    @abstractmethod
    def draw(self, rng: np.random.Generator, n: int) -> Floats:
        """Draws (n, P) of the parameters."""

    @abstractmethod
    def networks(self, parameters: Floats) -> Iterable[Network]:
        """The networks that go with parameters (n, P)."""

    @abstractmethod
    def variants(self, parameters: Floats) -> Floats | list[Network]:
        """What `simulate_posterior` takes for parameters (n, P): rate constants, or networks."""

    @abstractmethod
    def slopes(self) -> tuple[Network, Floats]:
        """The network at the means, and derivatives (P, R') of the logarithms of its rate constants: by the logarithm
        of each rate, and by each other parameter itself."""


@dataclass(frozen=True, eq=False)
class RatesPosterior(Posterior):
    """The posterior of P parameters: the K rates behind R channels, then the shape parameters of the break model.

    expansion : the network in which breaks have partners
    breaks : the break model, and the posterior of its shape
    rate_names : (K,) keys of the rates: the channels, or the classes and more general entries that a book uses
    known : (K,) the rates with their evidence; one without evidence is taken as known
    scales : (R',) factors on the rate constants, from the tank of the measurement to that of the use
    shares : (R, K) what each rate adds to the coefficient of a channel: the ways of its classes over all ways; None
        where every channel has its own

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
    rate_names: tuple[str, ...]
    known: tuple[MeasuredRate, ...]
    scales: Floats
    shares: Floats | None = None

    @property
    def rates(self) -> tuple[float, ...]:
        """Point rates (K,), 1/tu."""
        return tuple(rate.rate for rate in self.known)

    @property
    def events(self) -> tuple[float | None, ...]:
        """Events (K,) behind each rate."""
        return tuple(rate.events for rate in self.known)

    @property
    def exposure(self) -> tuple[float | None, ...]:
        """Exposure (K,) behind each rate, tu."""
        return tuple(rate.exposure for rate in self.known)

    @property
    def names(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names (P,) of the parameters."""
        return (*self.rate_names, *self.breaks.shape)

    @property
    def is_rate(self) -> Any:
        """Whether each parameter (P,) is a rate; the others are shape parameters."""
        return np.arange(len(self.names)) < len(self.known)

    def coefficients(self, rates: Floats) -> Floats:
        """Coefficients (n, R) of the channels, from rates (n, K)."""
        return rates if self.shares is None else np.asarray(rates @ self.shares.T)

    def parts(self, parameters: Floats) -> Floats:
        """The part (K, R') that each rate has in each rate constant at parameters (P,)."""
        if self.shares is None:
            return np.equal(self.expansion.base_of, np.arange(len(self.known))[:, None]).astype(np.float64)
        rates, shape = np.split(parameters, [len(self.known)])
        each = self.shares * rates * self.factors_at(shape[None, :])[0]
        each = np.where(each.any(axis=1, keepdims=True), each, self.shares)
        return np.asarray((each / each.sum(axis=1, keepdims=True)).T[:, self.expansion.base_of])

    def exposures_at(self, points: Floats) -> list[Floats | None]:
        """Exposure (G,) of each rate at shapes (G, S); None if it does not depend on them.

        ValueError: a rate whose exposure is known at the points of the shape's posterior alone, and another shape.
        """
        by_species = self._weights_at(points) if self.shares is None else None
        found = []
        for name, rate in zip(self.rate_names, self.known, strict=True):
            if by_species is None or rate.exposures is None:
                found.append(rate.exposure_at(self.breaks, points, name))
            else:
                found.append(by_species @ np.array(rate.exposures))
        return found

    @cached_property
    def mean(self) -> Floats:
        """Posterior means (P,); the value itself where a parameter is taken as known."""
        means = [self._gamma(r)[0] for r in range(len(self.known))]
        return np.append(means, self._shapes[1] @ self._shapes[0])

    @cached_property
    def covariance(self) -> Floats:
        """Posterior covariances (P, P)."""
        shapes, weights = self._shapes
        off = shapes - weights @ shapes
        table = np.zeros((len(self.names), len(self.names)))
        n = len(self.known)
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
        return inference_data(self, draws, chains, seed)

    def constants(self, parameters: ArrayLike) -> Floats:
        """Rate constants (n, R'), 1/tu, that go with parameters (n, P)."""
        table = np.asarray(parameters, dtype=float)
        rates, shapes = np.split(table.copy(), [len(self.known)], axis=1)
        points, which = np.unique(shapes, axis=0, return_inverse=True)
        rates *= self.factors_at(points)[which.ravel()]
        weights = self._weights_at(points)[which.ravel()]
        return self.expansion.constants(self.coefficients(rates), weights) * self.scales

    def factors_at(self, points: Floats) -> Floats:
        """Factors (G, R) on the rates at shapes (G, K) that keep the expected number of breaks at each shape."""
        factors = np.ones((len(points), len(self.known)))
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
        means = np.tile(self.mean[: len(self.known)], (len(shapes), 1))
        return np.asarray(weights @ self.constants(np.hstack([means, shapes])))

    @cached_property
    def expected(self) -> Network:
        """The network at the posterior mean of each rate constant."""
        return self.expansion.network.with_rates(self.expected_constants())

    def networks(self, parameters: Floats) -> Iterable[Network]:
        """The networks that go with parameters (n, P)."""
        return (self.expected.with_rates(constants) for constants in self.constants(parameters))

    def variants(self, parameters: Floats) -> Floats:
        """Rate constants (n, R') that go with parameters (n, P)."""
        return self.constants(parameters)

    def slopes(self) -> tuple[Network, Floats]:
        """The network at the means, and derivatives (P, R') of the logarithms of its rate constants.

        By the logarithm of a rate, of which they are multiples; by a shape parameter itself, by central differences of
        the closed form, extrapolated.
        """
        middle, n = self.mean, len(self.rates)
        steps = np.eye(middle.size)[n:] * STEP
        points = [middle[None, :], *(middle + k * steps for k in (1, -1, 2, -2))]
        (constants,), *moved = np.split(self.constants(np.vstack(points)), 1 + len(steps) * np.arange(4))
        one, two = (moved[0] - moved[1]) / (2 * STEP), (moved[2] - moved[3]) / (4 * STEP)
        by_shape = (4.0 * one - two) / 3.0
        held = np.where((constants == 0.0) & by_shape.any(axis=0), TINY * constants.max(), constants)
        by_rate = self.parts(middle) * (held > 0.0)
        return self.expansion.network.with_rates(held), np.vstack([by_rate, divided(by_shape, held)])

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
        events, exposure = self.known[r].events, self.known[r].exposure
        if events is None or exposure is None:
            return self.known[r].rate, 0.0
        shape, total = jeffreys_posterior(events, exposure)
        return shape / total, shape / total**2
