"""Predictions that carry the uncertainty of the rates."""

from kinetics.predicting.prediction import Prediction, predict

__all__ = ["Prediction", "predict"]
