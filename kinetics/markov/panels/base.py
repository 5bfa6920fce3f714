"""The base of all likelihoods: what one says of a model's parameters, whatever the data are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from kinetics.markov.panels.slopes import Slopes
from kinetics.network import Model, Network
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats


class Scored(NamedTuple):
    """A log-likelihood and its derivatives (P,) by the logarithm of each parameter.

    >>> import numpy as np
    >>> from kinetics.markov.panels import Scored
    >>> from kinetics.support.answer import Answer
    >>> Scored(Answer(-2.0, -2.0, -2.0), np.array([0.5])).gradient.tolist()
    [0.5]
    """

    answer: Answer
    gradient: Floats


class Observed(NamedTuple):
    """The parameter of how a column is observed, and the largest value that it may have."""

    value: float
    most: float


class Likelihood(ABC):
    """The log-likelihood of data at any values of the parameters of a model.

    Parameters are those of the network, its channels (for their rate constants), and columns of the data (for the
    parameter of their observation).

    >>> from kinetics.markov.panels import EventLikelihood, JointLikelihood, Likelihood, PanelLikelihood
    >>> [issubclass(each, Likelihood) for each in (EventLikelihood, JointLikelihood, PanelLikelihood)]
    [True, True, True]
    """

    model: Model

    @abstractmethod
    def scored(self, point: Mapping[str, float] | None, names: Sequence[str]) -> Scored:
        """The log-likelihood and its derivatives by the logarithms of the parameters `names`.

        point : values of some parameters; None: as the model has them
        """

    def value(self, point: Mapping[str, float] | None = None) -> Answer:
        """The log-likelihood at values of some parameters; None: as the model has them."""
        return self.scored(point, ()).answer

    @property
    def observed(self) -> Mapping[str, Observed]:
        """The parameters of observations, by column."""
        return {}

    @property
    @abstractmethod
    def data_digest(self) -> str:
        """SHA-256 of what was seen, whatever the model."""

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value of all that may be free."""
        network = self.model.network
        known = zip(network.channels, network.known_rates.tolist(), strict=True)
        formulas = {*network.laws, *network.given.rates}
        channels = {name: rate for name, rate in known if name not in formulas}
        return {**channels, **network.parameters, **{name: each.value for name, each in self.observed.items()}}

    @property
    def usually_free(self) -> tuple[str, ...]:
        """The parameters of the network; its channels if it has none."""
        return tuple(self.model.network.parameters or self.model.network.channels)

    @property
    def own(self) -> Sequence[str]:
        """Parameters of which each group of the data has its own."""
        return ()

    def shared(self, name: str) -> str:
        """What a parameter is called where groups share it."""
        return name

    @property
    def groups(self) -> Mapping[str, Likelihood]:
        """Its sets of data by name; "" for the only one."""
        return {"": self}

    def each(self, names: Sequence[str]) -> tuple[str, ...]:
        """Parameters of the model as they are called here: several for one of which each group has its own."""
        return tuple(dict.fromkeys(names))

    def called(self, name: str, part: str) -> str:  # noqa: ARG002
        """What a parameter of a set of data is called here."""
        return name

    def point_of(self, part: str, point: Mapping[str, float]) -> dict[str, float]:  # noqa: ARG002
        """The values of the parameters of a set of data."""
        return dict(point)

    @property
    @abstractmethod
    def size(self) -> dict[str, Any]:
        """How much was seen, ready for JSON: `runs`, and `looks` or `events`, and how columns are observed."""

    @property
    @abstractmethod
    def longest(self) -> float:
        """The time, tu, for which the longest run was observed."""

    def is_like(self, other: Likelihood) -> bool:
        """Whether the other has the same model, with the same formulas, and the same data."""
        ours, theirs = self.model.network, other.model.network
        return (
            (self.model.digest, self.data_digest) == (other.model.digest, other.data_digest)
            and ours.parameters == theirs.parameters
            and ours.given == theirs.given
        )

    def network_at(self, point: Mapping[str, float]) -> Network:
        """The network at these values; those of observations change nothing."""
        rest = {name: value for name, value in point.items() if name not in self.observed}
        return self.model.at(rest).network if rest else self.model.network

    def _slopes(
        self, network: Network, point: Mapping[str, float], names: Sequence[str], columns: Sequence[str] = ()
    ) -> Slopes:
        """How the rates, and the observations of `columns`, depend on the parameters `names`."""
        observed = {p: list(columns).index(name) for p, name in enumerate(names) if name in self.observed}
        known = {**self.model.network.parameters, **point}
        return Slopes(
            network, names, observed, known.__getitem__, lambda name, value: self.network_at({**point, name: value})
        )
