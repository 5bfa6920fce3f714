"""Derivatives of answers of a chain by all its rates, adjoint: one solution more for all of them, with bounds."""

from kinetics.markov.derivatives.at_a_time import Adjoint, adjoint_at, gradient_at, gradient_up_to
from kinetics.markov.derivatives.derivatives import Derivatives
from kinetics.markov.derivatives.eventually import (
    gradient_accumulated,
    gradient_always,
    gradient_steady,
    gradient_until,
)
from kinetics.markov.derivatives.gradient import ChannelEntries, Gradient
from kinetics.markov.derivatives.next_jump import gradient_next
from kinetics.markov.derivatives.passage_times import (
    LARGEST_ORDER,
    Density,
    gradient_moment,
    gradient_quantile,
    gradient_sd,
)
from kinetics.markov.derivatives.squaring import gradient_by_squaring

__all__ = [
    "LARGEST_ORDER",
    "Adjoint",
    "ChannelEntries",
    "Density",
    "Derivatives",
    "Gradient",
    "adjoint_at",
    "gradient_accumulated",
    "gradient_always",
    "gradient_at",
    "gradient_by_squaring",
    "gradient_moment",
    "gradient_next",
    "gradient_quantile",
    "gradient_sd",
    "gradient_steady",
    "gradient_until",
    "gradient_up_to",
]
