"""Validation of predictions on mechanics runs that the rates never saw."""
