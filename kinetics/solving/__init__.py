"""Solution of the master equation: the probability of every state over time, one file per method."""

from kinetics.solving.base import ListingMethod, SolvingMethod
from kinetics.solving.collocation import Collocation
from kinetics.solving.dense import Dense
from kinetics.solving.distribution import Distribution
from kinetics.solving.methods import SOLVING_METHODS, solve
from kinetics.solving.projection import FiniteStateProjection
from kinetics.solving.states import StateSpace, reachable
from kinetics.solving.transient import Transient
from kinetics.solving.transitions import Transitions

__all__ = [
    "SOLVING_METHODS",
    "Collocation",
    "Dense",
    "Distribution",
    "FiniteStateProjection",
    "ListingMethod",
    "SolvingMethod",
    "StateSpace",
    "Transient",
    "Transitions",
    "reachable",
    "solve",
]
