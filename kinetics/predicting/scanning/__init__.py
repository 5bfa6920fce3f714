"""Scans: questions to a model at every point of a grid of parameters, rate constants and counts at time 0."""

from kinetics.predicting.scanning.grid import scan
from kinetics.predicting.scanning.result import Scan
from kinetics.predicting.scanning.values import read_values

__all__ = ["Scan", "read_values", "scan"]
