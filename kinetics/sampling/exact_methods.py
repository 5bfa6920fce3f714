"""The tuple of the exact sampling methods, read by the command line, `auto`, hard cases and contract tests."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from __future__ import annotations

from kinetics.sampling.base import SamplingMethod
from kinetics.support.families import members

# To add one, see `SamplingMethod`. `sample_path` takes the first that takes the network.
from kinetics.sampling.direct import Direct
from kinetics.sampling.lockstep import Lockstep
from kinetics.sampling.partial import PartialPropensities
from kinetics.sampling.rejection import CompositionRejection
from kinetics.sampling.leaping import Leaping
from kinetics.sampling.general import General

EXACT_METHODS: tuple[type[SamplingMethod], ...] = members(globals(), SamplingMethod)
