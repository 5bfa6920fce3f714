"""Predictions with the uncertainty of the rates, their elasticities, and observables."""

from kinetics.predicting.elasticity import Elasticities, count_elasticities, passage_elasticities
from kinetics.predicting.passage_prediction import PassagePrediction, predict_passage
from kinetics.predicting.prediction import Prediction, predict

__all__ = [
    "Elasticities",
    "PassagePrediction",
    "Prediction",
    "count_elasticities",
    "passage_elasticities",
    "predict",
    "predict_passage",
]
