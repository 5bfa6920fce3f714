"""Accuracy of the mechanics against its CPU time, and the presets that follow from it."""
