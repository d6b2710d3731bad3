"""Adaptive FEM for scikit-fem: a Kohonen map moves the nodes of a mesh to where the error is."""

from .locate import interpolate
from .quality import quality

__all__ = ["interpolate", "quality"]

__version__ = "0.1.0"
