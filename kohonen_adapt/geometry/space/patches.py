"""Constrained faces of tetrahedra, and the patches into which they join.

A face is constrained if it lies on the outer boundary, between two regions, or on a named boundary.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshTet

from kohonen_adapt.arrays import Floats, Int8s, Ints, IntsPair, Mask, counted, grouped, unique_pairs
from kohonen_adapt.geometry.plane.curves import projected
from kohonen_adapt.geometry.space.surfaces import (
    Surface,
    on_cone,
    on_cylinder,
    on_plane,
    on_sphere,
)
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, PLANE, PROJECTED, SPHERE, Tetrahedra
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.host import ascending, keys_of
from kohonen_adapt.mesh.measures import angles_between
from kohonen_adapt.mesh.names import marked_facets
from kohonen_adapt.mesh.tetrahedralization import faces_of

__all__ = [
    "Edges",
    "Faces",
    "Patches",
    "Seams",
    "Shapes",
    "Sheet",
    "constrained_faces",
    "edges_of",
    "on_their_patches",
    "onto_all",
    "seams_of",
]

STILL = 1e-15  # displacement below which nodes are on all of their patches, relative to the size of the mesh
ROUNDS = 100  # maximum number of repetitions; the first suffices on two patches at right angles


class Faces(NamedTuple):
    element: Ints  # (f,)
    corner: Ints  # (f,) local index of the corner opposite to the face
    nodes: Ints  # (f, 3)
    label: Ints  # (f, 2) regions and names on both sides, seen from the element and from across
    sides: dict[str, Int8s]  # per boundary name (f,): 0, UNORIENTED, LEFT (of the element) or RIGHT
    regions: Ints  # (f, 2) of the element and of its neighbour, -1 outside


class Edges(NamedTuple):
    ends: Ints  # (g, 2) the nodes, ascending
    start: Ints  # (g + 1,) the faces around edge g are face[start[g]:start[g + 1]]
    face: Ints  # (3 f,)
    forth: Mask  # (3 f,) True if the face runs along the edge from its first to its second node

    @property
    def faces_around(self) -> Ints:
        return np.diff(self.start)


class Seams(NamedTuple):
    ends: Ints  # (j, 2) nodes
    faces: Ints  # (j, 2)
    turn: Floats  # (j,) angle between the faces in radians, 0 if they are coplanar
    opposite: Mask  # (j,) True if the elements of both faces are on the same side
    same_label: Mask  # (j,) True if names and regions on both sides are the same


def constrained_faces(mesh: MeshTet, elements: Tetrahedra) -> Faces:
    e, k, regions, label, sides = marked_facets(mesh, elements)
    return Faces(e, k, faces_of(elements, e, k), label, sides, regions)


def edges_of(faces: Faces, nnodes: int) -> Edges:
    start, end = faces.nodes.ravel(), np.roll(faces.nodes, -1, axis=1).ravel()
    code = keys_of(ascending(start, end), nnodes)
    order = np.argsort(code, kind="stable")
    first = np.flatnonzero(np.diff(code[order], prepend=-1))
    ends = np.stack(np.divmod(code[order][first], nnodes), axis=1)
    return Edges(ends, np.append(first, len(order)), order // 3, (start < end)[order])


def seams_of(faces: Faces, edges: Edges, position: Floats) -> Seams:
    edge = np.flatnonzero(edges.faces_around == 2)
    slot = edges.start[edge]
    one, other = edges.face[slot], edges.face[slot + 1]
    opposite = edges.forth[slot] != edges.forth[slot + 1]
    normal = normals(position, faces.nodes)
    here = normal[one]
    there = np.where(opposite[:, None], 1.0, -1.0) * normal[other]
    same_label = faces.label[one, 0] == faces.label[other, np.where(opposite, 0, 1)]
    return Seams(
        edges.ends[edge], np.stack([one, other], axis=1), angles_between(here.T, there.T), opposite, same_label
    )


class Shapes(NamedTuple):
    """Surfaces or curves, with the values of `Surfaces` in the kernels."""

    shape: Int8s  # (p,)
    origin: Floats  # (p, 3)
    axis: Floats  # (p, 3)
    size: Floats  # (p,)

    def set(self, p: int, row: tuple[int, Sequence[float] | Floats, Sequence[float] | Floats, float]) -> None:
        self.shape[p], self.origin[p], self.axis[p], self.size[p] = row


class Patches(NamedTuple):
    of_face: Ints  # (f,)
    shape: Int8s  # (p,)
    origin: Floats  # (p, 3)
    axis: Floats  # (p, 3)
    size: Floats  # (p,)
    surface_index: Ints  # (p,) index of the user-defined surface, -1 for none
    surfaces: dict[str, Surface]  # user-defined surfaces by boundary name
    front: Ints  # (p,) region in front of the patch, -1 if both sides are in the same region
    names: dict[str, Int8s]  # per boundary name (p,): 0, UNORIENTED, LEFT (of its front) or RIGHT
    sheet: "Sheet"

    @property
    def moves(self) -> Mask:
        """Mask (p,) of patches onto which nodes are projected, without recognised planes."""
        return (self.shape != PLANE) | (self.surface_index >= 0)

    def in_front(self, patch: Ints, region: Ints, position: Floats, nodes: Ints) -> Mask:
        """Return True for elements with faces (f, 3) on patches that lie in front."""
        found, rows = region == self.front[patch], self.front[patch] < 0
        centroids, out = position[nodes[rows]].mean(axis=1), normals(position, nodes[rows])
        found[rows] = self.sheet.faces_back(centroids, patch[rows], out)
        return found

    def project(self, patch: Ints, x: Floats) -> Floats:
        found = x.copy()
        shape = self.shape[patch]
        for kind, projection in ((PLANE, on_plane), (CYLINDER, on_cylinder), (CONE, on_cone), (SPHERE, on_sphere)):
            rows = np.flatnonzero(shape == kind)
            p = patch[rows]
            own = [self.origin[p], *[self.axis[p]] * (kind != SPHERE), *[self.size[p]] * (kind != PLANE)]
            found[rows] = projection(x[rows], *own)
        for number, (name, surface) in enumerate(self.surfaces.items()):
            rows = np.flatnonzero((shape == PROJECTED) & (self.surface_index[patch] == number))
            if len(rows):
                found[rows] = projected(surface, x[rows], name)
        return found


class Sheet(NamedTuple):
    """Faces of the input on patches that have the same region on both sides.

    The nearest of these faces decides which side of a moved face is the front.
    """

    tree: cKDTree  # centroids of the faces, with the patch index times `apart` as a fourth coordinate
    back: Floats  # (s, 3) normals of the faces, away from the front
    apart: float

    @classmethod
    def of(cls, centroids: Floats, patch: Ints, back: Floats, size: float) -> "Sheet":
        return cls(cKDTree(np.column_stack([centroids, patch * (10.0 * size)])), back, 10.0 * size)

    def faces_back(self, centroids: Floats, patch: Ints, out: Floats) -> Mask:
        nearest = self.tree.query(np.column_stack([centroids, patch * self.apart]))[1]
        return np.einsum("ij,ij->i", out, self.back[nearest]) > 0.0


def on_their_patches(nodes: Ints, patches: Patches, position: Floats) -> Floats:
    node, patch = unique_pairs(nodes.ravel(), np.repeat(patches.of_face, 3))
    bound = np.zeros(len(position), bool)
    bound[node[patches.moves[patch]]] = True
    node, patch = node[bound[node]], patch[bound[node]]
    rows = grouped(counted(np.bincount(node, minlength=1)))
    return onto_all([(node[own], patch[own]) for own in rows], patches, position)


def onto_all(sequence: Sequence[IntsPair], patches: Patches, position: Floats) -> Floats:
    x = position.copy()
    tolerance = STILL * np.ptp(position, axis=0).max()
    for _ in range(ROUNDS):
        before = x.copy()
        for node, patch in sequence:
            x[node] = patches.project(patch, x[node])
        if np.abs(x - before).max() <= tolerance:
            break
    return x
