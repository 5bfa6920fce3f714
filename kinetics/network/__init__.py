"""Reaction networks, their rate laws, and the tank in which they react."""

from kinetics.network.network import Network
from kinetics.network.predicates import Condition
from kinetics.network.tank import Tank

__all__ = ["Condition", "Network", "Tank"]
