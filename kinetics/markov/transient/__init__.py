"""Solution of the master equation: the probability of every state over time, one file per method."""

from kinetics.markov.transient.base import ListingMethod, SolvingMethod
from kinetics.markov.transient.collocation import Collocation
from kinetics.markov.transient.dense import Dense
from kinetics.markov.transient.distribution import Distribution
from kinetics.markov.transient.matrix_free import InterruptedSolutionError, MatrixFree
from kinetics.markov.transient.methods import SOLVING_METHODS, solve
from kinetics.markov.transient.projection import FiniteStateProjection
from kinetics.markov.transient.states import StateSpace, reachable
from kinetics.markov.transient.transient import Transient
from kinetics.markov.transient.transitions import Transitions

__all__ = [
    "SOLVING_METHODS",
    "Collocation",
    "Dense",
    "Distribution",
    "FiniteStateProjection",
    "InterruptedSolutionError",
    "ListingMethod",
    "MatrixFree",
    "SolvingMethod",
    "StateSpace",
    "Transient",
    "Transitions",
    "reachable",
    "solve",
]
