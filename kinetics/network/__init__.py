"""Reaction networks and their rate laws."""

from kinetics.network.network import Network

__all__ = ["Network"]
