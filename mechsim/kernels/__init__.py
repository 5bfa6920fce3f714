"""Compiled loops: arrays in, arrays out; they import numpy and numba only."""
