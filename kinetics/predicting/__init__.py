"""Predictions with the uncertainty of the rates, their elasticities, and observables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from kinetics.predicting.accuracy import AskedAccuracy, Reached
    from kinetics.predicting.elasticity import Elasticities, count_elasticities, passage_elasticities
    from kinetics.predicting.passage_prediction import PassagePrediction, predict_passage
    from kinetics.predicting.prediction import Prediction, predict

_HOMES = {
    "kinetics.predicting.accuracy": ("AskedAccuracy", "Reached"),
    "kinetics.predicting.elasticity": ("Elasticities", "count_elasticities", "passage_elasticities"),
    "kinetics.predicting.passage_prediction": ("PassagePrediction", "predict_passage"),
    "kinetics.predicting.prediction": ("Prediction", "predict"),
}

__all__ = [
    "AskedAccuracy",
    "Elasticities",
    "PassagePrediction",
    "Prediction",
    "Reached",
    "count_elasticities",
    "passage_elasticities",
    "predict",
    "predict_passage",
]

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
