"""Exact stochastic simulation: one file a method."""

from kinetics.sampling.auto import Auto
from kinetics.sampling.direct import Direct
from kinetics.sampling.general import General
from kinetics.sampling.lockstep import Lockstep
from kinetics.sampling.methods import SAMPLING_METHODS, SamplingMethod, sample_path, simulate
from kinetics.sampling.partial import PartialPropensities
from kinetics.sampling.rejection import CompositionRejection
from kinetics.sampling.streamed import simulate_statistics

__all__ = [
    "SAMPLING_METHODS",
    "Auto",
    "CompositionRejection",
    "Direct",
    "General",
    "Lockstep",
    "PartialPropensities",
    "SamplingMethod",
    "sample_path",
    "simulate",
    "simulate_statistics",
]
