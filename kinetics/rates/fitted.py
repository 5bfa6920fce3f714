"""Parameters that were fitted to data, with draws from their joint posterior, in TOML files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, field

from kinetics.network import Model, Network, Tank
from kinetics.network.checks import some_names
from kinetics.rates.break_terms import BreakTerms
from kinetics.rates.inference import arviz_data
from kinetics.rates.posterior import Posterior
from kinetics.support.arrays import Floats
from kinetics.support.config import find, read_toml, write_toml
from kinetics.support.settings import NotNegative, Positive, Settings, validated

NORMAL = 2000  # draws where a posterior is taken to be normal
STEP = 1e-5  # of the logarithm of a parameter, to both sides


class FittedParameter(Settings):
    """An estimate with its 95 % interval; an end that the data do not bound is left out.

    >>> from kinetics.rates.fitted import FittedParameter
    >>> FittedParameter(value=0.02, low=0.016).high is None
    True
    """

    value: Positive | None = None
    low: NotNegative | None = None
    high: NotNegative | None = None


class PosteriorDraws(Settings):
    """Draws from the joint posterior of some parameters.

    names, draws : of the parameters (P,), and their values (N, P)
    how : `sampled` from it, or `normal on logarithms` with the curvature of the likelihood at the estimates
    seed : of the random numbers
    r_hat, effective : of each parameter, if sampled: the ratio of Gelman & Rubin, and the effective number of draws

    >>> from kinetics.rates.fitted import PosteriorDraws
    >>> drawn = PosteriorDraws(how="sampled", names=("k",), draws=((0.1,), (0.2,)), seed=1)
    >>> drawn.table.tolist(), drawn.thinned(1).draws
    ([[0.1], [0.2]], ((0.1,),))
    """

    how: Literal["sampled", "normal on logarithms"]
    names: Annotated[tuple[str, ...], Meta(min_length=1)]
    draws: Annotated[tuple[tuple[Positive, ...], ...], Meta(min_length=1)]
    seed: int
    r_hat: dict[str, float] | None = None
    effective: dict[str, float] | None = None

    def __post_init__(self) -> None:
        if {len(row) for row in self.draws} != {len(self.names)}:
            raise ValueError(f"expected {len(self.names)} numbers in each draw, one for each of {self.names}")

    @property
    def table(self) -> Floats:
        """The draws (N, P)."""
        return np.array(self.draws)

    def to_arviz(self) -> Any:
        """The draws as ArviZ has them, in one chain: group `posterior`, a variable for each parameter; `arviz_data`."""
        found = {name: self.table[None, :, p] for p, name in enumerate(self.names)}
        return arviz_data(found, {}, {}, {}, {"seed": self.seed, "how": self.how})

    def thinned(self, most: int) -> PosteriorDraws:
        """At most so many of the draws, evenly spaced, to six digits."""
        kept = np.unique(np.linspace(0, len(self.draws) - 1, min(most, len(self.draws))).astype(int))
        return self.replace(draws=tuple(tuple(float(f"{x:.6g}") for x in self.draws[k]) for k in kept))


class FittedParameters(Settings):
    """Parameters of a model that were fitted to data: what `calibrate --counts` and its like write.

    parameters : name -> estimate and interval; of parameters of a network, channels (their rate constants), and
        columns of the data that were observed
    observed : the names that belong to observations, of which a prediction needs nothing
    posterior_draws : of all of them, if the posterior was sampled
    covariance_of_logarithms : (P, P) of the estimates with an interval, in their order; None if there is none. Without
        draws, the posterior is the normal distribution that has it; with neither, predictions have no interval
    log_likelihood, aic, notes, evaluations, evidence : of the fit

    >>> from kinetics import Network
    >>> from kinetics.rates import FittedParameters
    >>> drawn = {"how": "sampled", "names": ["k"], "draws": [[0.1], [0.2]], "seed": 1}
    >>> fitted = FittedParameters(parameters={"k": {"value": 0.14}}, posterior_draws=drawn)
    >>> decay = Network.from_text("A -> 0, k", k=1)
    >>> fitted.apply(decay).rate_constants.tolist(), fitted.expected(decay).rate_constants.round(9).tolist()
    ([0.14], [0.15])
    """

    parameters: Annotated[dict[str, FittedParameter], Meta(min_length=1)]
    fixed: dict[str, float] = field(default_factory=dict)
    observed: tuple[str, ...] = ()
    posterior_draws: PosteriorDraws | None = None
    log_likelihood: dict[str, Any] = field(default_factory=dict)
    aic: float | None = None
    covariance_of_logarithms: tuple[tuple[float, ...], ...] | None = None
    notes: tuple[str, ...] = ()
    evaluations: int | None = None
    evidence: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def load(cls, path: str | Path) -> FittedParameters:
        """Read a file that `save` or `calibrate` wrote."""
        found = find(path, Path(__file__).parent / "tables", "rates")
        return validated(cls, read_toml(found), found)

    def save(self, path: str | Path) -> None:
        """Write as TOML, whole or not at all."""
        write_toml(self.as_dict(none=False), Path(path))

    @property
    def values(self) -> dict[str, float]:
        """The estimates of what belongs to the network, and what was held; nothing that the data cannot tell."""
        known = {name: each.value for name, each in self.parameters.items() if each.value is not None}
        return {name: value for name, value in {**self.fixed, **known}.items() if name not in self.observed}

    @property
    def breaks(self) -> BreakTerms:
        """Of first order: a fitted model has the rates of its own channels."""
        return BreakTerms()

    @property
    def measured_in(self) -> None:
        """A model with its own volume has no tank."""

    @property
    def has_evidence(self) -> bool:
        """Whether anything is known of the posterior."""
        return self.posterior_draws is not None or self.covariance_of_logarithms is not None

    def without_evidence(self) -> list[str]:
        """Nothing has to be named: a posterior is that of all parameters."""
        return []

    @property
    def draws(self) -> PosteriorDraws | None:
        """Draws from the posterior: sampled, or 2,000 from the normal distribution on logarithms; None for neither."""
        if self.posterior_draws is not None or self.covariance_of_logarithms is None:
            return self.posterior_draws
        names = tuple(name for name, each in self.parameters.items() if each.value is not None)
        middle = np.log([self.parameters[name].value for name in names])  # type: ignore[arg-type]
        rng = np.random.default_rng(0)
        logs = rng.multivariate_normal(middle, np.array(self.covariance_of_logarithms), size=NORMAL, method="cholesky")
        rows = tuple(map(tuple, np.exp(np.clip(logs, -600.0, 600.0)).tolist()))
        return PosteriorDraws(how="normal on logarithms", names=names, draws=rows, seed=0)

    def apply(self, network: Network, tank: Tank | None = None) -> Network:  # noqa: ARG002
        """The network at the estimates.

        ValueError: it lacks a parameter, or the data cannot tell one
        """
        self._check(network)
        return Model.of(network).at(self.values).network

    def posterior(self, network: Network, tank: Tank | None = None) -> ParameterPosterior:  # noqa: ARG002
        """The posterior of the parameters that belong to the network."""
        drawn = self.draws
        if drawn is None:
            raise ValueError("nothing is known of the posterior of these parameters")
        kept = [p for p, name in enumerate(drawn.names) if name not in self.observed]
        names = tuple(drawn.names[p] for p in kept)
        return ParameterPosterior(self.apply(network), names, drawn.table[:, kept])

    def expected(self, network: Network, tank: Tank | None = None) -> Network:
        """The network at the posterior mean of each rate constant; at the estimates without a posterior."""
        return self.posterior(network, tank).expected if self.has_evidence else self.apply(network)

    def _check(self, network: Network) -> None:
        for name in self.observed:
            whole = name.partition("[")[0]
            if whole != name and whole in (*network.parameters, *network.channel_places):
                raise ValueError(
                    f"{whole} was fitted for each group of runs, as {name}; a prediction needs one value: fit the runs "
                    f"of one group, or all as one group"
                )
        known = {**dict.fromkeys(network.parameters), **network.channel_places}
        missing = [name for name in (*self.parameters, *self.fixed) if name not in known and name not in self.observed]
        if missing:
            raise ValueError(
                f"these parameters are of another network: it has no {some_names(missing)}; it has "
                f"{some_names(list(known))}"
            )
        untold = [name for name, each in self.parameters.items() if each.value is None and name not in self.observed]
        if untold:
            raise ValueError(
                f"the data could not tell {some_names(untold)}: fix it, as in calibrate --fix {untold[0]}=1"
            )


@dataclass(frozen=True, eq=False)
class ParameterPosterior(Posterior):
    """Draws of parameters, and the networks that go with them.

    network : at the estimates
    names : (P,) of parameters and channels
    table : (N, P) draws

    >>> from kinetics import Network
    >>> from kinetics.rates.fitted import ParameterPosterior
    >>> decay = Network.from_text("A -> 0, 2 * k", k=1)
    >>> posterior = ParameterPosterior(decay, ("k",), [[0.1], [0.3]])
    >>> posterior.constants([[0.1]]).tolist(), posterior.expected.rate_constants.tolist()
    ([[0.2]], [0.4])
    """

    network: Network
    names: tuple[str, ...]
    table: Floats

    @property
    def is_rate(self) -> Any:
        """All (P,) are above 0 and vary on their logarithms."""
        return np.ones(len(self.names), dtype=bool)

    @cached_property
    def mean(self) -> Floats:
        """Means (P,) of the draws."""
        return np.asarray(np.mean(self.table, axis=0))

    @cached_property
    def covariance(self) -> Floats:
        """Covariances (P, P) of the draws."""
        return np.atleast_2d(np.cov(np.asarray(self.table).T))

    def draw(self, rng: np.random.Generator, n: int) -> Floats:
        """Rows (n, P) chosen from the draws; each of them once before one comes twice."""
        size = len(self.table)
        rounds = [rng.permutation(size) for _ in range(-(-n // size))]
        return np.asarray(self.table)[np.concatenate(rounds)[:n]]

    def at(self, parameters: Sequence[float] | Floats) -> Network:
        """The network at parameters (P,)."""
        return Model.of(self.network).at(dict(zip(self.names, map(float, parameters), strict=True))).network

    def networks(self, parameters: Floats) -> list[Network]:
        """The networks at parameters (n, P)."""
        return [self.at(row) for row in np.asarray(parameters)]

    def constants(self, parameters: Any) -> Floats:
        """Rate constants (n, R), 1/tu, at parameters (n, P)."""
        return np.array([network.known_rates for network in self.networks(parameters)])

    def variants(self, parameters: Floats) -> Floats | list[Network]:
        """Rate constants (n, R); networks if parameters enter rate laws, too."""
        return self.networks(parameters) if self.network.laws else self.constants(parameters)

    @cached_property
    def expected(self) -> Network:
        """The network at the mean of each rate constant; with rate laws, at the mean of each parameter."""
        if self.network.laws:
            return self.at(self.mean)
        return self.network.with_rates(self.constants(self.table).mean(axis=0))

    def slopes(self) -> tuple[Network, Floats]:
        """The network at the means, and derivatives (P, R) of the logarithms of its constants by those of parameters.

        ValueError: rate laws, whose parameters are no constants
        """
        if self.network.laws:
            raise ValueError("elasticities are those of rate constants; this network has rate laws")
        moved = np.exp(STEP * np.eye(len(self.names)))
        above, below = (self.constants(self.mean * factors) for factors in (moved, 1.0 / moved))
        found = np.zeros(above.shape)
        happens = (above > 0.0) & (below > 0.0)
        found[happens] = np.log(above[happens] / below[happens]) / (2.0 * STEP)
        return self.at(self.mean), found
