"""Numba kernels: arrays in, arrays out; of ours they import each other only."""
