"""Chemical kinetics as Markov chains: reaction networks, their rates, and what they predict.

The names below are imported when they are first used, so that `import kinetics` stays fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.markov import Chain as Chain
    from kinetics.markov import Reward as Reward
    from kinetics.markov import Sensitivity as Sensitivity
    from kinetics.markov import committor as committor
    from kinetics.markov import first_passage as first_passage
    from kinetics.markov import reached_by as reached_by
    from kinetics.markov import stationary as stationary
    from kinetics.markov.passage import Committor as Committor
    from kinetics.markov.passage import Passage as Passage
    from kinetics.markov.passage import RareEvent as RareEvent
    from kinetics.markov.passage import Stationary as Stationary
    from kinetics.markov.passage import rare_event as rare_event
    from kinetics.markov.transient import Collocation as Collocation
    from kinetics.markov.transient import Dense as Dense
    from kinetics.markov.transient import Distribution as Distribution
    from kinetics.markov.transient import FiniteStateProjection as FiniteStateProjection
    from kinetics.markov.transient import MatrixFree as MatrixFree
    from kinetics.markov.transient import StateSpace as StateSpace
    from kinetics.markov.transient import Transient as Transient
    from kinetics.markov.transient import reachable as reachable
    from kinetics.markov.transient import solve as solve
    from kinetics.network import Model as Model
    from kinetics.network import Network as Network
    from kinetics.network import Tank as Tank
    from kinetics.networkfree import Growth as Growth
    from kinetics.networkfree import Growths as Growths
    from kinetics.networkfree import grow as grow
    from kinetics.predicting import PassagePrediction as PassagePrediction
    from kinetics.predicting import Prediction as Prediction
    from kinetics.predicting import predict as predict
    from kinetics.predicting import predict_passage as predict_passage
    from kinetics.predicting.ranking import Ranking as Ranking
    from kinetics.predicting.ranking import rank as rank
    from kinetics.predicting.scanning import Scan as Scan
    from kinetics.predicting.scanning import scan as scan
    from kinetics.rates import ChannelRate as ChannelRate
    from kinetics.rates import ClassRates as ClassRates
    from kinetics.rates import Convention as Convention
    from kinetics.rates import Rates as Rates
    from kinetics.rates.breaks import BREAK_MODELS as BREAK_MODELS
    from kinetics.rates.breaks import BreakModel as BreakModel
    from kinetics.rates.breaks import break_model as break_model
    from kinetics.runs import RESTART as RESTART
    from kinetics.runs import Ensemble as Ensemble
    from kinetics.runs import FirstTimes as FirstTimes
    from kinetics.runs import JumpPath as JumpPath
    from kinetics.sampling import Auto as Auto
    from kinetics.sampling import CompositionRejection as CompositionRejection
    from kinetics.sampling import Direct as Direct
    from kinetics.sampling import EnsembleStatistics as EnsembleStatistics
    from kinetics.sampling import General as General
    from kinetics.sampling import Leaping as Leaping
    from kinetics.sampling import Lockstep as Lockstep
    from kinetics.sampling import PartialPropensities as PartialPropensities
    from kinetics.sampling import sample_path as sample_path
    from kinetics.sampling import simulate as simulate
    from kinetics.sampling import simulate_statistics as simulate_statistics
    from kinetics.support.answer import Answer as Answer
    from kinetics.trust import Verification as Verification
    from kinetics.trust import verify as verify

__version__ = "0.2.0.dev0"
__project__ = "wellmixed"  # by which the command knows that this is ours

__getattr__, __dir__ = lazy_names(__name__)
