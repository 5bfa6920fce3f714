"""Tail extrapolation (peaks over threshold) for rare breaks, from the loads that runs have logged."""
