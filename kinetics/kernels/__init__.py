"""Numba kernels: arrays in, arrays out; the only project modules they import are other kernels.

`kernels.direct.ensemble`: a module of kernels is imported, and Numba with it, when something of it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.kernels import balance as balance
    from kinetics.kernels import blocks as blocks
    from kinetics.kernels import clauses as clauses
    from kinetics.kernels import direct as direct
    from kinetics.kernels import elimination as elimination
    from kinetics.kernels import exploration as exploration
    from kinetics.kernels import exposures as exposures
    from kinetics.kernels import general as general
    from kinetics.kernels import grouped as grouped
    from kinetics.kernels import incomplete as incomplete
    from kinetics.kernels import krylov as krylov
    from kinetics.kernels import leap_plan as leap_plan
    from kinetics.kernels import leaping as leaping
    from kinetics.kernels import lockstep as lockstep
    from kinetics.kernels import markov as markov
    from kinetics.kernels import members as members
    from kinetics.kernels import packed as packed
    from kinetics.kernels import partial as partial
    from kinetics.kernels import programs as programs
    from kinetics.kernels import rejection as rejection
    from kinetics.kernels import residuals as residuals
    from kinetics.kernels import statistics as statistics
    from kinetics.kernels import streams as streams

__getattr__, __dir__ = lazy_names(__name__)
