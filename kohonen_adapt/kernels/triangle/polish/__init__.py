"""Kernels of the energy descent on triangles."""
