"""Adaptive FEM for scikit-fem: a Kohonen map moves the nodes of a mesh to where the error is."""

from .density import density_from_indicators, density_from_sizes
from .locate import interpolate
from .quality import quality
from .relocate import relocate
from .schedule import Schedule, Stage
from .som import KohonenMap

__all__ = [
    "KohonenMap",
    "Schedule",
    "Stage",
    "density_from_indicators",
    "density_from_sizes",
    "interpolate",
    "quality",
    "relocate",
]

__version__ = "0.1.0"
