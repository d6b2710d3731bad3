"""Fence around the inner modules of numba."""
