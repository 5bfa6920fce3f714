"""Composition and rejection: exact trajectories of networks with very many channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.methods.groups import grouped_sampler
from kinetics.methods.sampling import ExactMethod, Sampler
from kinetics.methods.shape import Shape
from kinetics.network import Network


@dataclass(frozen=True)
class CompositionRejection(ExactMethod):
    """Composition and rejection over groups of channels (Slepoy, Thompson & Plimpton 2008). Exact.

    Choose it for thousands of channels, each event changing a few of them: the cost of an event grows with those, not
    with the number of channels.
    """

    name: ClassVar[str] = "rejection"

    def cost(self, shape: Shape) -> float:
        """Processor time of an event, ns; the last part is for memory out of reach of the caches."""
        return 55.0 + shape.update_cost + 0.0025 * shape.n_channels

    def sampler(self, network: Network) -> Sampler:
        """The network with its dependency graph, ready for `kernels.grouped`."""
        return grouped_sampler(network, in_bins=True)
