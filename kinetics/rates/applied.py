"""What a prediction asks of a file of rates, and the base of those that are events over exposure."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from kinetics.network import Network, Tank
from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.breaks import Expansion
from kinetics.rates.measured import MeasuredRate
from kinetics.rates.posterior import Posterior, RatesPosterior
from kinetics.support.arrays import Floats


class AppliedRates(Protocol):
    """What a prediction asks of any file of rates, however they were found."""

    @property
    def breaks(self) -> BreakTerms:
        """How breaks depend on their partners."""

    @property
    def measured_in(self) -> Tank | None:
        """The tank in which the rates were measured; None if that is not known, or there is none."""

    @property
    def has_evidence(self) -> bool:
        """Whether any rate has an uncertainty."""

    def without_evidence(self) -> list[str]:
        """What is taken as exact, because its uncertainty is not known."""

    def apply(self, network: Network, tank: Tank | None = None) -> Network:
        """`network` with these rates; tank : where they are used, None for where they were measured."""

    def posterior(self, network: Network, tank: Tank | None = None) -> Posterior:
        """The posterior of the parameters behind the rate constants of `apply(network, tank)`."""

    def expected(self, network: Network, tank: Tank | None = None) -> Network:
        """The network of `apply` with the posterior mean of each rate constant."""


class MeasuredRates:
    """Rates that are events over exposure, by channel or by class; the base of both."""

    __slots__ = ()

    breaks: BreakTerms
    tank: tuple[float, float, float] | None

    def expansion(self, network: Network) -> Expansion:
        """The network with these rates, expanded by the break model.

        ValueError: the rates are those of another network.
        """
        raise NotImplementedError

    def crowded(self, expansion: Expansion, tank: Tank | None) -> Expansion:  # noqa: ARG002
        """The expansion with the factors of the crowd in the tank of use; as it is if these rates have none."""
        return expansion

    def known(self, network: Network) -> tuple[dict[str, MeasuredRate], Floats | None]:
        """The rates behind the channels by name, and their shares in each, see `RatesPosterior`."""
        raise NotImplementedError

    def apply(self, network: Network, tank: Tank | None = None) -> Network:
        """`network` with the rates, ways and combinations of this table, its breaks expanded by their partners.

        network : one channel a break, as a rule book gives it
        tank : where the rates are to be used; None for the tank in which they were measured

        Cost: linear in breaks times partners.
        ValueError: the two do not have the same channels (in any order), the fingerprints differ, or another tank is
        asked for and this table does not state its own.
        """
        expansion = self.crowded(self.expansion(network), tank)
        constants = expansion.constants(expansion.base.known_rates, self.breaks.weights(expansion.base))
        return expansion.network.with_rates(constants * expansion.scales(self.measured_in, tank))

    def posterior(self, network: Network, tank: Tank | None = None) -> RatesPosterior:
        """The posterior of the parameters behind the rate constants of `apply(network, tank)`."""
        expansion = self.crowded(self.expansion(network), tank)
        known, shares = self.known(network)
        scales = expansion.scales(self.measured_in, tank)
        return RatesPosterior(expansion, self.breaks, tuple(known), tuple(known.values()), scales, shares)

    def expected(self, network: Network, tank: Tank | None = None) -> Network:
        """The network of `apply` with the posterior mean of each rate constant; the point rate if there is no evidence.

        A channel without events then has a rate above 0: half an event in its exposure.
        """
        return self.posterior(network, tank).expected

    @property
    def measured_in(self) -> Tank | None:
        """The tank in which the rates were measured."""
        return None if self.tank is None else Tank(self.tank)

    def draw_constants(self, network: Network, rng: np.random.Generator, n: int, tank: Tank | None = None) -> Floats:
        """Posterior draws (n, R') of the rate constants of `apply(network, tank)`, 1/tu; see `RatesPosterior`."""
        posterior = self.posterior(network, tank)
        return posterior.constants(posterior.draw(rng, n))
