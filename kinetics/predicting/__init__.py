"""Predictions with the uncertainty of the rates, their elasticities, and observables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.predicting.accuracy import AskedAccuracy as AskedAccuracy
    from kinetics.predicting.accuracy import Reached as Reached
    from kinetics.predicting.elasticity import Elasticities as Elasticities
    from kinetics.predicting.elasticity import count_elasticities as count_elasticities
    from kinetics.predicting.elasticity import passage_elasticities as passage_elasticities
    from kinetics.predicting.job import Job as Job
    from kinetics.predicting.observables import Observables as Observables
    from kinetics.predicting.passage_prediction import PassagePrediction as PassagePrediction
    from kinetics.predicting.passage_prediction import predict_passage as predict_passage
    from kinetics.predicting.prediction import Prediction as Prediction
    from kinetics.predicting.prediction import predict as predict
    from kinetics.predicting.prediction import predict_job as predict_job

__getattr__, __dir__ = lazy_names(__name__)
