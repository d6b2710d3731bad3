"""List the patches that faces of tetrahedra are part of: where each is, its sides and names; put nodes on them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.kernels.tetrahedron.arrays import CONE, CYLINDER, PLANE, PROJECTED, SPHERE
from kohonen_adapt.outline.curves import projected
from kohonen_adapt.outline.surfaces import (
    Surface,
    on_cone,
    on_cylinder,
    on_plane,
    on_sphere,
)

__all__ = ["Patches", "Sheet", "on_their_patches", "onto_all"]

STILL = 1e-15  # of the size of the mesh: nodes that projections move no farther are on all of their patches
ROUNDS = 100  # of projections; on two patches at right angles the first one does it


class Patches(NamedTuple):
    """The patches, a row each, and which of them every constrained face is part of."""

    of_face: Ints  # (f,)
    shape: NDArray[np.int8]  # (p,)
    origin: Floats  # (p, 3)
    axis: Floats  # (p, 3)
    size: Floats  # (p,)
    given: Ints  # (p,) which of the surfaces told for boundaries, -1 for none
    surfaces: dict[str, Surface]  # those, by name
    front: Ints  # (p,) the region on its front, -1 where both sides are in one
    names: dict[str, NDArray[np.int8]]  # per boundary name (p,): 0, UNORIENTED, LEFT (of its front) or RIGHT
    sheet: "Sheet"

    @property
    def moves(self) -> Mask:
        """Patches whose nodes may have to be put there: all but planes that the nodes themselves told, (p,)."""
        return (self.shape != PLANE) | (self.given >= 0)

    def project(self, patch: Ints, x: Floats) -> Floats:
        """The points of patches (k,) nearest to x, (k, 3)."""
        found, shape = x.copy(), self.shape[patch]
        for kind, put in ((PLANE, on_plane), (CYLINDER, on_cylinder), (CONE, on_cone), (SPHERE, on_sphere)):
            rows = np.flatnonzero(shape == kind)
            p = patch[rows]
            own = [self.origin[p], *[self.axis[p]] * (kind != SPHERE), *[self.size[p]] * (kind != PLANE)]
            found[rows] = put(x[rows], *own)
        for number, (name, surface) in enumerate(self.surfaces.items()):
            rows = np.flatnonzero((shape == PROJECTED) & (self.given[patch] == number))
            if len(rows):
                found[rows] = projected(surface, x[rows], name)
        return found


class Sheet(NamedTuple):
    """The faces, as they were, of patches with one region on both sides: what tells one side from the other."""

    tree: cKDTree  # of the middles of faces, and of their patches times `apart`
    back: Floats  # (s, 3) normals of those faces, away from the front
    apart: float

    @classmethod
    def of(cls, middles: Floats, patch: Ints, back: Floats, size: float) -> "Sheet":
        """Of faces of these patches, in a mesh of that size."""
        return cls(cKDTree(np.column_stack([middles, patch * (10.0 * size)])), back, 10.0 * size)

    def looks_back(self, middles: Floats, patch: Ints, out: Floats) -> Mask:
        """Whether faces of patches (k,) look away from the front by their normals, as the nearest face did."""
        nearest = self.tree.query(np.column_stack([middles, patch * self.apart]))[1]
        return np.einsum("ij,ij->i", out, self.back[nearest]) > 0.0


def on_their_patches(nodes: Ints, patches: Patches, position: Floats) -> Floats:
    """Where nodes would be were each on all of its patches, (n, 3), the faces being of these nodes (f, 3).

    Those of plane patches alone are where they are.
    """
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


def onto_all(turns: Sequence[tuple[Ints, Ints]], patches: Patches, position: Floats) -> Floats:
    """Project nodes on one patch after the other, over and over, as `turns` of nodes and their patches say."""
    x, still = position.copy(), STILL * np.ptp(position, axis=0).max()
    for _ in range(ROUNDS):
        before = x.copy()
        for node, patch in turns:
            x[node] = patches.project(patch, x[node])
        if np.abs(x - before).max() <= still:
            break
    return x
