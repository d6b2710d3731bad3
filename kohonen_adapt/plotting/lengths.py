"""Axes on which a mesh is drawn: lengths in a unit, equal scales."""

import numpy as np
from matplotlib.axes import Axes
from skfem import MeshTri

from kohonen_adapt.display import in_unit

__all__ = ["set_axes"]


def set_axes(axes: Axes, mesh: MeshTri, unit: str) -> None:
    """Equal scales, a little room around the mesh, units."""
    low, high = (in_unit(unit) * bound for bound in (mesh.p.min(axis=1), mesh.p.max(axis=1)))
    room = 0.02 * np.max(high - low)
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")
    axes.set(xlabel=f"x ({unit})" if unit else "x", ylabel=f"y ({unit})" if unit else "y")
