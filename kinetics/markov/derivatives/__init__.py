"""Derivatives of answers of a chain by all its rates, adjoint: one solution more for all of them, with limits."""

from kinetics.markov.derivatives.at_a_time import slopes_at, slopes_up_to
from kinetics.markov.derivatives.derivatives import Derivatives
from kinetics.markov.derivatives.eventually import slopes_always, slopes_earned, slopes_in_the_end, slopes_until
from kinetics.markov.derivatives.passage_times import LARGEST_ORDER, Density, slopes_moment, slopes_quantile, slopes_sd
from kinetics.markov.derivatives.slopes import ChannelEntries, Slopes
from kinetics.markov.derivatives.squaring import slopes_by_squaring

__all__ = [
    "LARGEST_ORDER",
    "ChannelEntries",
    "Density",
    "Derivatives",
    "Slopes",
    "slopes_always",
    "slopes_at",
    "slopes_by_squaring",
    "slopes_earned",
    "slopes_in_the_end",
    "slopes_moment",
    "slopes_quantile",
    "slopes_sd",
    "slopes_until",
    "slopes_up_to",
]
