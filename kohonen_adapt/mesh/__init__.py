"""Meshes of scikit-fem as arrays for kernels, and back with every name."""
