"""Exact stochastic simulation, one file per method, and statistics of its runs."""

from kinetics.sampling.auto import Auto
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.direct import Direct
from kinetics.sampling.draws import exposures_of_draws, first_times_of_draws, simulate_posterior
from kinetics.sampling.exact_methods import EXACT_METHODS
from kinetics.sampling.general import General
from kinetics.sampling.leaping import Leaping
from kinetics.sampling.lockstep import Lockstep
from kinetics.sampling.methods import SAMPLING_METHODS, sample_path, simulate
from kinetics.sampling.partial import PartialPropensities
from kinetics.sampling.rejection import CompositionRejection
from kinetics.sampling.statistics import EnsembleStatistics
from kinetics.sampling.streamed import simulate_statistics

__all__ = [
    "EXACT_METHODS",
    "SAMPLING_METHODS",
    "Auto",
    "CompositionRejection",
    "Direct",
    "EnsembleStatistics",
    "General",
    "Leaping",
    "Lockstep",
    "PartialPropensities",
    "SamplingMethod",
    "exposures_of_draws",
    "first_times_of_draws",
    "sample_path",
    "simulate",
    "simulate_posterior",
    "simulate_statistics",
]
