"""The exact sampling methods, in one tuple; command line, `auto`, hard cases and contract tests read it."""

from __future__ import annotations

from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.direct import Direct
from kinetics.sampling.general import General
from kinetics.sampling.lockstep import Lockstep
from kinetics.sampling.partial import PartialPropensities
from kinetics.sampling.rejection import CompositionRejection

# To add one, see `SamplingMethod`. `sample_path` takes the first that takes the network.
EXACT_METHODS: tuple[type[SamplingMethod], ...] = (
    Direct,
    Lockstep,
    PartialPropensities,
    CompositionRejection,
    General,
)
