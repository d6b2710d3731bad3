"""Adaptive finite elements for scikit-fem, with nodes where errors are."""

from kohonen_adapt import estimators
from kohonen_adapt.geometry.plane.curves import Arc, Line
from kohonen_adapt.geometry.plane.spline import Spline
from kohonen_adapt.geometry.rules import Rules
from kohonen_adapt.geometry.singular_layers import refined_at
from kohonen_adapt.geometry.space.surfaces import Cone, Cylinder, Plane, Sphere
from kohonen_adapt.io import read_curves, read_field, read_groups, read_mesh, write_mesh
from kohonen_adapt.loop.adapt import adapt
from kohonen_adapt.loop.passes import Pass, Status
from kohonen_adapt.loop.result import AdaptResult
from kohonen_adapt.loop.single_steps import polish, relocate, why_held
from kohonen_adapt.mesh.joining import merge
from kohonen_adapt.mesh.locate import find_elements, interpolate
from kohonen_adapt.mesh.measures import quality
from kohonen_adapt.mesh.motions import Reflection, Rotation, Translation
from kohonen_adapt.mesh.turning import turned
from kohonen_adapt.precompile import warmup
from kohonen_adapt.problem.protocol import NotOffered, Problem
from kohonen_adapt.problem.ritz import Ritz
from kohonen_adapt.som.density import density_from_indicators, density_from_sizes
from kohonen_adapt.som.hessian_metric import metric_from_hessian
from kohonen_adapt.som.kohonen_map import KohonenMap
from kohonen_adapt.som.schedule import Schedule, Stage
from kohonen_adapt.sweeps.cases import SweepResult
from kohonen_adapt.sweeps.sweep import sweep
from kohonen_adapt.version import __version__ as __version__

__all__ = [
    "AdaptResult",
    "Arc",
    "Cone",
    "Cylinder",
    "KohonenMap",
    "Line",
    "NotOffered",
    "Pass",
    "Plane",
    "Problem",
    "Reflection",
    "Ritz",
    "Rotation",
    "Rules",
    "Schedule",
    "Sphere",
    "Spline",
    "Stage",
    "Status",
    "SweepResult",
    "Translation",
    "adapt",
    "density_from_indicators",
    "density_from_sizes",
    "estimators",
    "find_elements",
    "interpolate",
    "merge",
    "metric_from_hessian",
    "polish",
    "quality",
    "read_curves",
    "read_field",
    "read_groups",
    "read_mesh",
    "refined_at",
    "relocate",
    "sweep",
    "turned",
    "warmup",
    "why_held",
    "write_mesh",
]


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
