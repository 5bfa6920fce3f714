"""Observation models: how a true count becomes the number in a table, one file each."""

# ruff: noqa: I001 - the imports of observations are the list, the simplest first

from __future__ import annotations

from kinetics.markov.panels.observations.base import Observation
from kinetics.support.families import members

# To add one, see `Observation`.
from kinetics.markov.panels.observations.exact import Exact as Exact
from kinetics.markov.panels.observations.detected import Detected as Detected
from kinetics.markov.panels.observations.rounded import Rounded as Rounded
from kinetics.markov.panels.observations.censored import Censored as Censored
from kinetics.markov.panels.observations.gaussian import Gaussian as Gaussian

OBSERVATIONS: tuple[type[Observation], ...] = members(globals(), Observation)

__all__ = ["OBSERVATIONS", "Censored", "Detected", "Exact", "Gaussian", "Observation", "Rounded"]
