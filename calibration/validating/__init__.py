"""Prediction held against mechanics that the rates never saw."""
