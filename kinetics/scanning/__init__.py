"""Scans: questions to a model at every point of a grid of parameters, rate constants and counts at time 0."""

from kinetics.scanning.answer import ScanAnswer
from kinetics.scanning.grid import scan
from kinetics.scanning.result import Scan
from kinetics.scanning.scanned import ScannedModel
from kinetics.scanning.values import read_values

__all__ = ["Scan", "ScanAnswer", "ScannedModel", "read_values", "scan"]
