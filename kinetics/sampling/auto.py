"""The quickest exact method for a network, by rules that were measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.network import Network
from kinetics.sampling.base import Candidate, ExactMethod, Sampler
from kinetics.sampling.cost_model import Shape
from kinetics.sampling.direct import Direct
from kinetics.sampling.general import General
from kinetics.sampling.lockstep import Lockstep
from kinetics.sampling.partial import PartialPropensities
from kinetics.sampling.rejection import CompositionRejection

CANDIDATES: tuple[type[Candidate], ...] = (Direct, PartialPropensities, CompositionRejection)


@dataclass(frozen=True)
class Auto(ExactMethod):
    """The exact method whose events are expected to cost least, see `cost` of each.

    many : expect ensembles, for which the direct method can run in lockstep; False for a few long runs

    The choice depends on the network and on `many` alone, so the same seed gives the same runs however many are asked
    for, at whatever times. Where it is the direct method, these are the runs of `Direct`, to the last bit.
    """

    many: bool = True
    name: ClassVar[str] = "auto"

    def choose(self, network: Network) -> ExactMethod:
        """The method for this network."""
        if not network.is_mass_action:
            return General()
        shape = Shape.of(network)
        candidates: tuple[type[Candidate], ...] = (*CANDIDATES, Lockstep) if self.many else CANDIDATES
        return min((method() for method in candidates), key=lambda method: method.cost(shape))

    def sampler(self, network: Network) -> Sampler:
        """The network made ready for the chosen method."""
        return self.choose(network).sampler(network)
