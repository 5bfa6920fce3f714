"""Chemical kinetics as Markov chains: reaction networks, their rates, and what they predict.

The names below are imported when they are first used, so that `import kinetics` stays fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.markov import Chain, Reward, Sensitivity, committor, first_passage, stationary
    from kinetics.markov.passage import Committor, Passage, RareEvent, Stationary, rare_event
    from kinetics.markov.transient import (
        Collocation,
        Dense,
        Distribution,
        FiniteStateProjection,
        StateSpace,
        Transient,
        reachable,
        solve,
    )
    from kinetics.network import Model, Network, Tank
    from kinetics.networkfree import Growth, Growths, grow
    from kinetics.predicting import PassagePrediction, Prediction, predict, predict_passage
    from kinetics.predicting.ranking import Ranking, rank
    from kinetics.predicting.scanning import Scan, scan
    from kinetics.rates import ChannelRate, ClassRates, Convention, Rates
    from kinetics.rates.breaks import BREAK_MODELS, BreakModel, break_model
    from kinetics.runs import RESTART, Ensemble, EnsembleStatistics, FirstTimes, JumpPath
    from kinetics.sampling import (
        Auto,
        CompositionRejection,
        Direct,
        General,
        Leaping,
        Lockstep,
        PartialPropensities,
        sample_path,
        simulate,
        simulate_statistics,
    )
    from kinetics.support.answer import Answer
    from kinetics.trust import Verification, verify

__version__ = "0.2.0.dev0"
__project__ = "wellmixed"  # by which the command knows that this is ours

_HOMES = {
    "kinetics.rates.breaks": ("BREAK_MODELS", "BreakModel", "break_model"),
    "kinetics.markov": ("Chain", "Reward", "Sensitivity", "committor", "first_passage", "stationary"),
    "kinetics.network": ("Model", "Network", "Tank"),
    "kinetics.networkfree": ("Growth", "Growths", "grow"),
    "kinetics.markov.passage": ("Passage", "RareEvent", "Committor", "Stationary", "rare_event"),
    "kinetics.predicting": ("PassagePrediction", "Prediction", "predict", "predict_passage"),
    "kinetics.predicting.ranking": ("Ranking", "rank"),
    "kinetics.rates": ("ChannelRate", "ClassRates", "Convention", "Rates"),
    "kinetics.runs": ("RESTART", "Ensemble", "EnsembleStatistics", "FirstTimes", "JumpPath"),
    "kinetics.sampling": (
        *("Auto", "CompositionRejection", "Direct", "General", "Leaping", "Lockstep", "PartialPropensities"),
        *("sample_path", "simulate", "simulate_statistics"),
    ),
    "kinetics.predicting.scanning": ("Scan", "scan"),
    "kinetics.markov.transient": (
        *("Collocation", "Dense", "Distribution", "FiniteStateProjection", "StateSpace", "Transient"),
        *("reachable", "solve"),
    ),
    "kinetics.support.answer": ("Answer",),
    "kinetics.trust": ("Verification", "verify"),
}

__all__ = [
    "BREAK_MODELS",
    "RESTART",
    "Answer",
    "Auto",
    "BreakModel",
    "Chain",
    "ChannelRate",
    "ClassRates",
    "Collocation",
    "Committor",
    "CompositionRejection",
    "Convention",
    "Dense",
    "Direct",
    "Distribution",
    "Ensemble",
    "EnsembleStatistics",
    "FiniteStateProjection",
    "FirstTimes",
    "General",
    "Growth",
    "Growths",
    "JumpPath",
    "Leaping",
    "Lockstep",
    "Model",
    "Network",
    "PartialPropensities",
    "Passage",
    "PassagePrediction",
    "Prediction",
    "Ranking",
    "RareEvent",
    "Rates",
    "Reward",
    "Scan",
    "Sensitivity",
    "StateSpace",
    "Stationary",
    "Tank",
    "Transient",
    "Verification",
    "__version__",
    "break_model",
    "committor",
    "first_passage",
    "grow",
    "predict",
    "predict_passage",
    "rank",
    "rare_event",
    "reachable",
    "sample_path",
    "scan",
    "simulate",
    "simulate_statistics",
    "solve",
    "stationary",
    "verify",
]

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
