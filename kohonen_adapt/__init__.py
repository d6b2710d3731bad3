"""Adaptive FEM for scikit-fem: a Kohonen map moves the nodes of a mesh to where the error is."""

from . import estimators
from .curves import Arc, Line, Spline
from .density import density_from_indicators, density_from_sizes
from .descent import polish
from .io import read_curves, read_groups, read_mesh, write_mesh
from .locate import find_elements, interpolate
from .loop import adapt
from .precompile import warmup
from .problem import Problem
from .relocation import relocate
from .result import AdaptResult, Pass, Status
from .ritz import Ritz
from .schedule import Schedule, Stage
from .som import KohonenMap
from .triangles import quality

__all__ = [
    "AdaptResult",
    "Arc",
    "KohonenMap",
    "Line",
    "Pass",
    "Problem",
    "Ritz",
    "Schedule",
    "Spline",
    "Stage",
    "Status",
    "adapt",
    "density_from_indicators",
    "density_from_sizes",
    "estimators",
    "find_elements",
    "interpolate",
    "polish",
    "quality",
    "read_curves",
    "read_groups",
    "read_mesh",
    "relocate",
    "warmup",
    "write_mesh",
]

__version__ = "0.4.0"


def __dir__() -> list[str]:
    """What is for users, without the rooms it comes from."""
    return [*__all__, "__version__"]
