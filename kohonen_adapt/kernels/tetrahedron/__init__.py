"""Compiled kernels on tetrahedra."""
