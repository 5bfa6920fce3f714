"""Kernels in C, beside their twins by Numba: what an ordinary command needs starts without a compiler."""
