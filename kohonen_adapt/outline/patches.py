"""Join constrained faces to patches: connected, smooth, and alike in names and regions on both sides."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.tetrahedron.arrays import PLANE
from kohonen_adapt.mesh.tetrahedralization import normals
from kohonen_adapt.outline.faces import Faces, Seams
from kohonen_adapt.outline.facets import turned

__all__ = ["Patches", "patches_of"]

TURN = 1e-6  # radians: where faces turn by no more they are in one plane


class Patches(NamedTuple):
    """The patches, a row each, and which of them every constrained face is part of."""

    of_face: Ints  # (f,)
    shape: NDArray[np.int8]  # (p,)
    origin: Floats  # (p, 3)
    axis: Floats  # (p, 3)
    size: Floats  # (p,)
    front: Ints  # (p,) the region on its front, -1 where both sides are in one: `axis` points away from it then
    names: dict[str, NDArray[np.int8]]  # per boundary name (p,): 0, UNORIENTED, LEFT (of its front) or RIGHT


def patches_of(faces: Faces, seams: Seams, position: Floats) -> Patches:
    """Join faces to plane patches, which are numbered in the order of their first faces."""
    patch = joined(len(faces.element), seams.faces[seams.alike & (seams.turn <= TURN)])
    first = np.unique(patch, return_index=True)[1]
    axis = plane_normals(faces, patch, position)
    region, behind = faces.regions[first].T
    front = np.where(region == behind, -1, region)
    outward = normals(position, faces.nodes[first])
    is_front = (front >= 0) | (np.einsum("ij,ij->i", outward, axis) > 0.0)
    names = {name: turned(side[first], is_front) for name, side in faces.sides.items()}
    shape, size = np.full(len(first), PLANE, dtype=np.int8), np.zeros(len(first))
    return Patches(patch, shape, position[faces.nodes[first, 0]], axis, size, front, names)


def joined(count: int, pairs: Ints) -> Ints:
    """Number of the connected set of every one of `count` things, (count,), in the order of their first ones."""
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), tuple(pairs.T)), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number]


def plane_normals(faces: Faces, patch: Ints, position: Floats) -> Floats:
    """Unit normals of the planes of patches, (p, 3): the mean over the faces by area."""
    across = normals(position, faces.nodes)
    largest = np.lexsort((-np.einsum("ij,ij->i", across, across), patch))
    reference = across[largest[np.flatnonzero(np.diff(patch[largest], prepend=-1))]]
    across *= np.sign(np.einsum("ij,ij->i", across, reference[patch]))[:, None]
    total = np.stack([np.bincount(patch, weights=column) for column in across.T], axis=1)
    return total / np.linalg.norm(total, axis=1, keepdims=True)
