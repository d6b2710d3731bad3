"""Fence around numba: compilation of kernels, records as arguments, and a cache of machine code."""
