"""Compiled kernels of the mechanics: arrays in, arrays out; they import numpy and numba only."""
