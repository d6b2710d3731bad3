"""Kernels of the energy descent on tetrahedra."""
