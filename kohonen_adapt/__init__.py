"""Adaptive FEM for scikit-fem: a Kohonen map moves the nodes of a mesh to where the error is."""

__version__ = "0.1.0"
