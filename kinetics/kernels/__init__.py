"""Numba kernels: arrays in, arrays out; the only project modules they import are other kernels."""
