"""Chemical kinetics as Markov chains: reaction networks, their rates, and what they predict.

The names below are imported when they are first used, so that `import kinetics` stays light.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.late import late_names

if TYPE_CHECKING:
    from kinetics.classrates import ClassRates
    from kinetics.methods import (
        Auto,
        CompositionRejection,
        Dense,
        Direct,
        FiniteStateProjection,
        Lockstep,
        PartialPropensities,
        Transient,
        sample_path,
        simulate,
        solve,
    )
    from kinetics.methods.distribution import Distribution
    from kinetics.methods.passage import Passage, first_passage
    from kinetics.methods.rare import RareEvent, rare_event
    from kinetics.methods.splitting import Splitting, splitting
    from kinetics.methods.stationary import Stationary, stationary
    from kinetics.methods.streamed import simulate_statistics
    from kinetics.network import Network
    from kinetics.networkfree import grow
    from kinetics.networkfree_paths import Growth, Growths
    from kinetics.paths import RESTART, Ensemble, JumpPath
    from kinetics.prediction import Prediction, predict
    from kinetics.ranking import Ranking, rank
    from kinetics.rates import ChannelRate, Convention, Rates
    from kinetics.states import StateSpace, reachable
    from kinetics.statistics import EnsembleStatistics
    from kinetics.verification import Verification, verify

_HOMES = {
    "kinetics.classrates": ("ClassRates",),
    "kinetics.methods": (
        "Auto",
        "CompositionRejection",
        "Dense",
        "Direct",
        "FiniteStateProjection",
        "Lockstep",
        "PartialPropensities",
        "Transient",
        "sample_path",
        "simulate",
        "solve",
    ),
    "kinetics.methods.distribution": ("Distribution",),
    "kinetics.methods.passage": ("Passage", "first_passage"),
    "kinetics.methods.rare": ("RareEvent", "rare_event"),
    "kinetics.methods.splitting": ("Splitting", "splitting"),
    "kinetics.methods.stationary": ("Stationary", "stationary"),
    "kinetics.methods.streamed": ("simulate_statistics",),
    "kinetics.network": ("Network",),
    "kinetics.networkfree": ("grow",),
    "kinetics.networkfree_paths": ("Growth", "Growths"),
    "kinetics.paths": ("RESTART", "Ensemble", "JumpPath"),
    "kinetics.prediction": ("Prediction", "predict"),
    "kinetics.ranking": ("Ranking", "rank"),
    "kinetics.rates": ("ChannelRate", "Convention", "Rates"),
    "kinetics.states": ("StateSpace", "reachable"),
    "kinetics.statistics": ("EnsembleStatistics",),
    "kinetics.verification": ("Verification", "verify"),
}

__all__ = [
    "RESTART",
    "Auto",
    "ChannelRate",
    "ClassRates",
    "CompositionRejection",
    "Convention",
    "Dense",
    "Direct",
    "Distribution",
    "Ensemble",
    "EnsembleStatistics",
    "FiniteStateProjection",
    "Growth",
    "Growths",
    "JumpPath",
    "Lockstep",
    "Network",
    "PartialPropensities",
    "Passage",
    "Prediction",
    "Ranking",
    "RareEvent",
    "Rates",
    "Splitting",
    "StateSpace",
    "Stationary",
    "Transient",
    "Verification",
    "first_passage",
    "grow",
    "predict",
    "rank",
    "rare_event",
    "reachable",
    "sample_path",
    "simulate",
    "simulate_statistics",
    "solve",
    "splitting",
    "stationary",
    "verify",
]

__getattr__ = late_names(__name__, _HOMES)
