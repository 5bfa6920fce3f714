"""Predictions with the uncertainty of the rates, and observables."""

from kinetics.predicting.prediction import Prediction, predict

__all__ = ["Prediction", "predict"]
