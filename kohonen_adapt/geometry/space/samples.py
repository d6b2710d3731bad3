"""Samples of surfaces with a user-defined projection, for the kernels.

Kernels cannot call the method `project` of a surface. They use the paraboloid at the nearest sample instead.
"""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.geometry.space.faces import Faces
from kohonen_adapt.geometry.space.patches import Patches
from kohonen_adapt.kernels.tetrahedron.arrays import NO_SAMPLES, PROJECTED, Samples
from kohonen_adapt.mesh.cells import normals

__all__ = ["samples_of"]

CUTS = 4  # number of parts into which the lattice divides an edge
STEP = 1e-2  # step of the differences, relative to an edge


def samples_of(faces: Faces, patches: Patches, position: Floats) -> Samples:
    """Return points, normals and second derivatives of user-defined surfaces."""
    if not np.any(patches.shape == PROJECTED):
        return NO_SAMPLES
    start, samples = [0], []
    for p in range(len(patches.shape)):
        rows = 0
        if patches.shape[p] == PROJECTED:
            own = np.flatnonzero(patches.of_face == p)
            point, face = lattice(position[faces.nodes[own]])
            found = shapes_at(
                patches, p, point, position[faces.nodes[own]][face], out_of(faces, patches, own, position)[face]
            )
            order = in_tree(found[0])
            samples.append([array[order] for array in found])
            rows = len(order)
        start.append(start[-1] + rows)
    return Samples(np.array(start, dtype=np.int32), *map(np.concatenate, zip(*samples, strict=True)))


def out_of(faces: Faces, patches: Patches, own: Ints, position: Floats) -> Floats:
    nodes, patch = faces.nodes[own], patches.of_face[own]
    normal = normals(position, nodes)
    away = faces.regions[own, 0] == patches.front[patch]
    sheet = patches.front[patch] < 0
    away[sheet] = patches.sheet.faces_back(position[nodes[sheet]].mean(axis=1), patch[sheet], normal[sheet])
    return np.where(away[:, None], normal, -normal)


def lattice(corners: Floats) -> tuple[Floats, Ints]:
    a, b, c = corners.transpose(1, 0, 2)
    fractions = [(i / CUTS, j / CUTS) for i in range(CUTS + 1) for j in range(CUTS + 1 - i)]
    point, rows = np.unique(
        np.concatenate([a + s * (b - a) + t * (c - a) for s, t in fractions]), axis=0, return_index=True
    )
    return point, rows % len(corners)


def shapes_at(patches: Patches, p: int, near: Floats, corners: Floats, out: Floats) -> tuple[Floats, Floats, Floats]:
    """Return points, normals and second derivatives of patch `p`.

    Points (k, 3) are the nearest to `near`. Unit normals (k, 3) point to the side of `out`. Second derivatives
    (k, 3, 3) of the height along the normal are differences along the edges of faces.
    """
    patch = np.full(len(near), p)
    point = patches.project(patch, near)
    along, aside = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    directions = along, aside, along + aside
    ends = [
        [patches.project(patch, point + step * direction) - point for step in (STEP, -STEP)] for direction in directions
    ]
    tangent = np.stack([ahead - back for ahead, back in ends[:2]], axis=2) / (2.0 * STEP)
    normal = np.cross(tangent[:, :, 0], tangent[:, :, 1])
    flat = ~(np.einsum("ij,ij->i", normal, normal) > 0.0)  # no tangent plane beyond the rim of the surface
    normal[flat] = out[flat]
    normal[np.einsum("ij,ij->i", normal, out) < 0.0] *= -1.0
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first, second, both = (np.einsum("ij,ij->i", ahead + back, normal) / STEP**2 for ahead, back in ends)
    mixed = 0.5 * (both - first - second)
    second_derivatives = np.stack([first, mixed, mixed, second], axis=1).reshape(-1, 2, 2)
    inverse = np.linalg.pinv(tangent)
    return point, normal, inverse.transpose(0, 2, 1) @ second_derivatives @ inverse


def in_tree(point: Floats) -> Ints:
    """Return the indices of points in the order of a complete tree, some repeated."""
    depth = len(point).bit_length()
    rows = np.minimum(np.arange(2**depth - 1), len(point) - 1)
    tree = np.empty(0, dtype=np.int64)
    for level in range(depth):
        block = rows.reshape(2**level, -1)
        block = np.take_along_axis(block, np.argsort(point[block, level % 3], axis=1, kind="stable"), axis=1)
        half = block.shape[1] // 2
        tree = np.append(tree, block[:, half])
        rows = np.delete(block, half, axis=1).ravel()
    return tree
