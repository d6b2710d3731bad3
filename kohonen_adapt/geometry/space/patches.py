"""Patches of constrained faces, and the projection of nodes onto them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.plane.curves import projected
from kohonen_adapt.geometry.space.surfaces import (
    Surface,
    on_cone,
    on_cylinder,
    on_plane,
    on_sphere,
)
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, PLANE, PROJECTED, SPHERE

__all__ = ["Patches", "Sheet", "on_their_patches", "onto_all"]

STILL = 1e-15  # displacement below which nodes are on all of their patches, relative to the size of the mesh
ROUNDS = 100  # maximum number of repetitions; the first suffices on two patches at right angles


class Patches(NamedTuple):
    """Patches, and the patch of every constrained face."""

    of_face: Ints  # (f,)
    shape: NDArray[np.int8]  # (p,)
    origin: Floats  # (p, 3)
    axis: Floats  # (p, 3)
    size: Floats  # (p,)
    surface_index: Ints  # (p,) index of the user-defined surface, -1 for none
    surfaces: dict[str, Surface]  # user-defined surfaces by boundary name
    front: Ints  # (p,) region in front of the patch, -1 if both sides are in the same region
    names: dict[str, NDArray[np.int8]]  # per boundary name (p,): 0, UNORIENTED, LEFT (of its front) or RIGHT
    sheet: "Sheet"

    @property
    def moves(self) -> Mask:
        """Mask (p,) of patches onto which nodes are projected, without recognised planes."""
        return (self.shape != PLANE) | (self.surface_index >= 0)

    def project(self, patch: Ints, x: Floats) -> Floats:
        found, shape = x.copy(), self.shape[patch]
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
    count = len(patches.shape)
    there = np.unique(nodes.ravel() * np.int64(count) + np.repeat(patches.of_face, 3))
    node, patch = np.divmod(there, max(count, 1))
    bound = np.zeros(len(position), dtype=bool)
    bound[node[patches.moves[patch]]] = True
    node, patch = node[bound[node]], patch[bound[node]]
    first = np.flatnonzero(np.diff(node, prepend=-1))
    rank = np.arange(len(node)) - np.repeat(first, np.diff(np.append(first, len(node))))
    rows = [rank == k for k in range(int(rank.max(initial=-1)) + 1)]
    return onto_all([(node[own], patch[own]) for own in rows], patches, position)


def onto_all(sequence: Sequence[tuple[Ints, Ints]], patches: Patches, position: Floats) -> Floats:
    x, tolerance = position.copy(), STILL * np.ptp(position, axis=0).max()
    for _ in range(ROUNDS):
        before = x.copy()
        for node, patch in sequence:
            x[node] = patches.project(patch, x[node])
        if np.abs(x - before).max() <= tolerance:
            break
    return x
