"""Solution of the master equation: the probability of every state over time, one file per method."""

from kinetics.solving.base import SolvingMethod
from kinetics.solving.collocation import Collocation
from kinetics.solving.dense import Dense
from kinetics.solving.distribution import Distribution
from kinetics.solving.methods import SOLVING_METHODS, solve
from kinetics.solving.projection import FiniteStateProjection
from kinetics.solving.states import StateSpace, reachable
from kinetics.solving.transient import Transient

__all__ = [
    "SOLVING_METHODS",
    "Collocation",
    "Dense",
    "Distribution",
    "FiniteStateProjection",
    "SolvingMethod",
    "StateSpace",
    "Transient",
    "reachable",
    "solve",
]
