"""Constrained faces of tetrahedra, and the edges in which they meet.

A face is constrained if it lies on the outer boundary, between two regions, or on a named boundary.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.names import labels, manners_of
from kohonen_adapt.mesh.tetrahedralization import FACES, Tetrahedralization, facet_of_face

__all__ = ["Edges", "Faces", "Seams", "constrained_faces", "edges_of", "seams_of"]


class Faces(NamedTuple):
    """Constrained faces, counter-clockwise seen from outside their element."""

    element: Ints  # (f,)
    corner: Ints  # (f,) local index of the corner opposite to the face
    nodes: Ints  # (f, 3)
    label: Ints  # (f, 2) regions and names on both sides, seen from the element and from across
    sides: dict[str, NDArray[np.int8]]  # per boundary name (f,): 0, UNORIENTED, LEFT (of the element) or RIGHT
    regions: Ints  # (f, 2) of the element and of its neighbour, -1 outside


class Edges(NamedTuple):
    """Edges of constrained faces, each with the faces around."""

    ends: Ints  # (g, 2) the nodes, ascending
    start: Ints  # (g + 1,) the faces around edge g are face[start[g]:start[g + 1]]
    face: Ints  # (3 f,)
    forth: Mask  # (3 f,) True if the face runs along the edge from its first to its second node

    @property
    def faces_around(self) -> Ints:
        return np.diff(self.start)


class Seams(NamedTuple):
    """Edges in which exactly two constrained faces meet."""

    edge: Ints  # (j,)
    faces: Ints  # (j, 2)
    turn: Floats  # (j,) angle between the faces in radians, 0 if they are coplanar
    opposite: Mask  # (j,) True if the elements of both faces are on the same side
    same_label: Mask  # (j,) True if names and regions on both sides are the same


def constrained_faces(tet: Tetrahedralization) -> Faces:
    mesh, tetrahedra = tet.mesh, tet.elements
    across, own = tetrahedra.neighbour, tetrahedra.region[:, None]
    other = np.where(across >= 0, tetrahedra.region[across], -1)
    marked = other != own
    boundaries = mesh.boundaries or {}
    facet = facet_of_face(mesh, tetrahedra.node) if boundaries else None
    if facet is not None:
        named = np.zeros(mesh.facets.shape[1], dtype=bool)
        named[np.concatenate([np.asarray(rows, dtype=np.int64) for rows in boundaries.values()])] = True
        marked |= named[facet]
    e, k = np.nonzero(marked & ((across < 0) | (across > np.arange(len(own))[:, None])))
    nodes = np.take_along_axis(tetrahedra.node[e], FACES[k], axis=1)
    sides = {} if facet is None else {n: manners_of(mesh, rows, facet[e, k], e) for n, rows in boundaries.items()}
    regions = np.stack([tetrahedra.region[e], other[e, k]], axis=1)
    label = labels(regions[:, 0], regions[:, 1], list(sides.values()))
    return Faces(e, k, nodes, label, sides, regions)


def edges_of(faces: Faces, nnodes: int) -> Edges:
    start, end = faces.nodes.ravel(), np.roll(faces.nodes, -1, axis=1).ravel()
    code = np.minimum(start, end).astype(np.int64) * nnodes + np.maximum(start, end)
    order = np.argsort(code, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(code[order]) != 0)[: len(order)])
    ends = np.stack(np.divmod(code[order][first], nnodes), axis=1)
    return Edges(ends, np.append(first, len(order)), order // 3, (start < end)[order])


def seams_of(faces: Faces, edges: Edges, position: Floats) -> Seams:
    edge = np.flatnonzero(edges.faces_around == 2)
    slot = edges.start[edge]
    one, other = edges.face[slot], edges.face[slot + 1]
    opposite = edges.forth[slot] != edges.forth[slot + 1]
    normal = normals(position, faces.nodes)
    here, there = normal[one], np.where(opposite[:, None], 1.0, -1.0) * normal[other]
    turn = np.arctan2(np.linalg.norm(np.cross(here, there), axis=1), np.einsum("ij,ij->i", here, there))
    same_label = faces.label[one, 0] == faces.label[other, np.where(opposite, 0, 1)]
    return Seams(edge, np.stack([one, other], axis=1), turn, opposite, same_label)
