"""Say which elements have curved sides, or are around an axis, and where these are integrated."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.arrays import Modes, Points, Shapes
from kohonen_adapt.mesh.near_axis import kinds_at_axis
from kohonen_adapt.mesh.points import by_points, fields_at
from kohonen_adapt.mesh.polynomials import gradients, local_coefficients
from kohonen_adapt.mesh.triangulation import Triangulation
from kohonen_adapt.problem.ritz import Ritz, integrated

__all__ = ["kinds_of", "shapes_of", "steepest", "without_modes"]


def shapes_of(ritz: Ritz, bent: Floats, rows: int) -> tuple[Points, Shapes]:
    """The points of a functional, and the shapes of all elements, in so many rows; those not in use are straight.

    For the displacements of the sides of those in use, (m, 3, 2).
    """
    bend = np.zeros((rows, 3, 2))
    bend[: len(bent)] = bent
    special = np.any(bend != 0.0, axis=(1, 2)) | ritz.axisymmetric
    return by_points(ritz.order), Shapes(bend, special, ritz.axisymmetric)


def kinds_of(ritz: Ritz, triangulation: Triangulation) -> Ints | None:
    """The kinds of all elements around an axis, (m,); None in the plane."""
    return kinds_at_axis(triangulation.position[triangulation.elements.node, 0]) if ritz.axisymmetric else None


def without_modes(m: int) -> Modes:
    """The modes of functions of order 1, of which there are none."""
    return Modes(np.empty((m, 3, 0)), np.zeros(m), np.zeros((m, 3), dtype=np.bool_))


def steepest(ritz: Ritz, triangulation: Triangulation, values: Floats, modes: Modes | None) -> float:
    """The largest gradient of a function, around an axis by x."""
    node = triangulation.elements.node
    coefficients, corners = local_coefficients(values[node], modes), triangulation.position[node]
    kind = kinds_of(ritz, triangulation)
    if kind is None:
        return float(np.hypot(*gradients(corners, coefficients, integrated(ritz))[1]).max(initial=0.0))
    points, largest = by_points(ritz.order), 0.0
    for one in np.unique(kind):
        rows = np.flatnonzero(kind == one)
        _, x, _, slope = fields_at(points, int(one), corners[rows], np.zeros_like(corners[rows]), coefficients[rows])
        largest = max(largest, float((np.hypot(*slope) / x).max()))
    return largest
