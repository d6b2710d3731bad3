"""Constrained facets of triangles, and the polylines into which they join.

A facet is constrained if it lies on the outer boundary, between two regions, or on a named boundary.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.polylines import CORNER, Polylines, angles_between, joined_ends, trace_polylines
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.names import labels, manners_of
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Facets", "Joints", "constrained_facets", "facet_of_edge", "joints_of", "trace_facets"]


class Facets(NamedTuple):
    """Constrained facets, counter-clockwise in their element."""

    element: Ints  # (f,)
    corner: Ints  # (f,) local index of the corner opposite to the facet
    nodes: Ints  # (f, 2)
    label: Ints  # (f, 2) regions and names on both sides, seen along and against the facet
    sides: dict[str, NDArray[np.int8]]  # per boundary name (f,): 0, UNORIENTED, LEFT or RIGHT


class Joints(NamedTuple):
    """Nodes in which exactly two constrained facets meet."""

    node: Ints  # (j,)
    facets: Ints  # (j, 2)
    ends: Ints  # (j, 2) other nodes of the facets
    turn: Floats  # (j,) angle between the facets in radians
    smooth: Mask  # (j,) True if a curve may pass: same names and regions on both sides, no sharp turn


def constrained_facets(triangulation: Triangulation) -> Facets:
    mesh, elements = triangulation.mesh, triangulation.elements
    across, own = elements.neighbour, elements.region[:, None]
    other = np.where(across >= 0, elements.region[across], -1)
    marked = other != own
    boundaries = mesh.boundaries or {}
    facet = facet_of_edge(mesh, elements.node) if boundaries else None
    if boundaries:
        named = np.zeros(mesh.facets.shape[1], dtype=bool)
        named[np.concatenate([np.asarray(rows, dtype=np.int64) for rows in boundaries.values()])] = True
        marked |= named[facet]
    e, k = np.nonzero(marked & ((across < 0) | (across > np.arange(len(own))[:, None])))
    nodes = np.stack(elements.ends(e, k), axis=1)
    sides = {} if facet is None else {n: manners_of(mesh, rows, facet[e, k], e) for n, rows in boundaries.items()}
    return Facets(e, k, nodes, labels(elements.region[e], other[e, k], list(sides.values())), sides)


def facet_of_edge(mesh: MeshTri, node: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the index in `mesh` of the facet opposite to each corner, (m, 3)."""
    number_facets(mesh)
    facet = np.empty_like(node)
    for row in range(3):  # scikit-fem orders the facets of an element by their corners: 01, 12, 02
        corner = np.argmax(node == mesh.t[(row + 2) % 3][:, None], axis=1)
        facet[np.arange(len(node)), corner] = mesh.t2f[row]
    return facet


def joints_of(facets: Facets, position: Floats, cornerless: Mask, offset: Floats | float = 0.0) -> Joints:
    """Return the joints, the nodes in which exactly two facets meet.

    Facets of the mask `cornerless`, shape (f,), join smoothly at any angle. `offset`, shape (f, 2), is the midside
    offset, with which the turn is the angle between parabolas.
    """
    node, rows = joined_ends(facets.nodes, len(position))
    other = facets.nodes.ravel()[rows ^ 1]
    # the path arrives along the first facet and leaves along the second, so labels may be reversed
    before, after = facets.label[rows[:, 0] // 2, 1 - rows[:, 0] % 2], facets.label[rows[:, 1] // 2, rows[:, 1] % 2]
    tangent_change = np.broadcast_to(4.0 * offset, facets.nodes.shape)
    turn = angles_between(
        *(position[other[:, side]] - position[node] + tangent_change[rows[:, side] // 2] for side in (0, 1))
    )
    smooth = (turn < CORNER) | np.all(cornerless[rows // 2], axis=1)
    return Joints(node, rows // 2, other, turn, (before == after) & smooth)


def trace_facets(facets: Facets, joints: Joints, stops: Mask) -> Polylines:
    through = np.full((len(stops), 2), -1, dtype=np.int32)
    continuing = joints.smooth & ~stops[joints.node]
    through[joints.node[continuing]] = joints.facets[continuing]
    return trace_polylines(facets.nodes, through)
