"""Every array that the loops over tetrahedra share, in records: its shape, its type and what it says.

Letters of shapes: n nodes, m elements, p patches, r ridges. Where no type is given it is float64. A *patch* is a
connected set of constrained faces (outer, between regions, or named) that is smooth and carries the same names; a
*ridge* is a curve along which patches meet, or a patch ends; nodes where ridges meet or turn are *corners*.
"""

from typing import NamedTuple

import numpy as np

from kohonen_adapt.kernels.records import record

PLANE, SPHERE, CYLINDER, CONE, PROJECTED = range(5)  # shapes of patches; nodes on PROJECTED ones are held by loops
LINE, CIRCLE, INTERSECTION = range(3)  # shapes of ridges; an INTERSECTION is on both of its patches and nothing more
HELD, ON_RIDGE, ON_PATCH, INSIDE = range(4)  # `Freedom.number`: how many directions a node has


@record
class Tetrahedra(NamedTuple):
    """Tetrahedra of positive volume; ``neighbour[e, k]`` lies across the face opposite to corner k, -1 outside.

    With corners a, b, c, d the product (b - a) . ((c - a) x (d - a)) is six times the volume.
    """

    node: np.ndarray  # (m, 4) int32; rows that are not in use begin with -1
    neighbour: np.ndarray  # (m, 4) int32
    region: np.ndarray  # (m,) int32
    patch: np.ndarray  # (m, 4) int32: of the face opposite to corner k, -1 for one that is free to be swapped


@record
class Surfaces(NamedTuple):
    """Where patches are, and the ridges between them."""

    shape: np.ndarray  # (p,) int8: PLANE, SPHERE, CYLINDER, CONE, PROJECTED
    origin: np.ndarray  # (p, 3): a point of a plane or an axis, a centre, an apex
    axis: np.ndarray  # (p, 3): unit normal of a plane, direction of an axis; that of a cone points into it
    size: np.ndarray  # (p,): radius of a sphere or a cylinder, half angle of a cone
    meets: np.ndarray  # (r, 4) int32: the patches that meet in a ridge, ascending, then -1
    ridge_shape: np.ndarray  # (r,) int8: LINE, CIRCLE, INTERSECTION
    ridge_origin: np.ndarray  # (r, 3): a point of a line, the centre of a circle
    ridge_axis: np.ndarray  # (r, 3): direction of a line, unit normal of the plane of a circle
    ridge_size: np.ndarray  # (r,): radius of a circle


@record
class Freedom(NamedTuple):
    """Where each node may go."""

    number: np.ndarray  # (n,) int8: HELD, ON_RIDGE, ON_PATCH, INSIDE
    place: np.ndarray  # (n,) int32: the ridge or patch that a node slides on, -1 for others
    pinned: np.ndarray  # (n,) bool: held because the user says so; an edge between two of them is not split
