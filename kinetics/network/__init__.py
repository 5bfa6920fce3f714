"""Reaction networks, their rate laws, the models made of them, and the tank in which they react."""

from kinetics.network.crowding import Crowding
from kinetics.network.model import Model
from kinetics.network.network import Network
from kinetics.network.tank import Tank

__all__ = ["Crowding", "Model", "Network", "Tank"]
