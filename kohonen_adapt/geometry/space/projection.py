"""Projection onto patches and ridges, and samples of surfaces for kernels.

Kernels cannot call the method `project` of a user-defined surface. They use the paraboloid at the nearest sample.
"""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask
from kohonen_adapt.geometry.space.patches import Faces, Patches, onto_all
from kohonen_adapt.kernels.tetrahedron.arrays import (
    CIRCLE,
    LINE,
    NO_SAMPLES,
    ON_PATCH,
    ON_RIDGE,
    PROJECTED,
    Freedom,
    Samples,
    Surfaces,
    Tetrahedra,
)
from kohonen_adapt.mesh.cells import normals
from kohonen_adapt.mesh.measures import qualities_of
from kohonen_adapt.mesh.tetrahedralization import faces_of, faces_on

__all__ = [
    "distances_from_faces",
    "midpoints_of_edges",
    "move_to_targets",
    "projected_positions",
    "samples_of",
    "volume_cut_off",
]

STILL = 1e-13  # distance from the target below which nodes are not moved, relative to the size of the mesh
HALVINGS = 4  # maximum number of halvings of displacements that violate the quality rule
SMALL = 1e-4  # maximum size of a small displacement, relative to the element
CUTS = 4  # number of parts into which the lattice divides an edge
STEP = 1e-2  # step of the differences, relative to an edge


def projected_positions(position: Floats, surfaces: Surfaces, freedom: Freedom, patches: Patches) -> Floats:
    x = position.copy()
    on = np.flatnonzero(freedom.number == ON_PATCH)
    on = on[patches.moves[freedom.place[on]]]
    x[on] = patches.project(freedom.place[on], x[on])
    on = np.flatnonzero(freedom.number == ON_RIDGE)
    meets, shape = surfaces.meets[freedom.place[on]], surfaces.ridge_shape[freedom.place[on]]
    bound = np.any(np.append(patches.moves, False)[meets], axis=1) | (shape != LINE)
    on, meets, shape = on[bound], meets[bound], shape[bound]
    x[on] = onto_all([(on[each >= 0], each[each >= 0]) for each in meets.T], patches, x)[on]
    for kind in (LINE, CIRCLE):
        own = on[shape == kind]
        x[own] = onto_ridges(x[own], freedom.place[own], surfaces, is_line=kind == LINE)
    return x


def onto_ridges(x: Floats, ridge: Ints, surfaces: Surfaces, is_line: bool) -> Floats:
    origin, axis = surfaces.ridge_origin[ridge], surfaces.ridge_axis[ridge]
    along = axis * np.sum((x - origin) * axis, axis=1, keepdims=True)
    if is_line:
        return origin + along
    out = x - origin - along
    length = np.linalg.norm(out, axis=1, keepdims=True)
    return origin + out * (surfaces.ridge_size[ridge, None] / np.where(length > 0.0, length, 1.0))


def move_to_targets(position: Floats, elements: Tetrahedra, target: Floats, floor: float) -> Floats:
    """Return positions with nodes moved to `target`, (n, 3), all at once.

    The quality of an element may fall to `floor`. If a displacement violates this limit, the nodes of the element move
    by a half, a quarter, ..., and at last not at all. Below `floor`, quality may decrease by a hundred times the
    displacement relative to the element size, if this ratio is at most `SMALL`.
    """
    node = elements.node[elements.node[:, 0] >= 0]
    far = np.abs(target - position).max(axis=1) > STILL * np.ptp(position, axis=0).max()
    touched = node[far[node].any(axis=1)]
    before = qualities(position, touched)
    least = np.minimum(floor, before * (1.0 - 100.0 * small_displacements(position, target, touched)))
    fraction = far.astype(np.float64)
    for step in range(HALVINGS + 1):
        moved = position + fraction[:, None] * (target - position)
        bad = violating(moved, touched, least)
        if not bad.any():
            break
        fraction[touched[bad]] *= 0.5 if step < HALVINGS else 0.0
    while (bad := violating(moved, touched, least)).any():  # elements nearby relied on displacements that are now 0
        fraction[touched[bad]] = 0.0
        moved = position + fraction[:, None] * (target - position)
    return np.where(fraction[:, None] == 1.0, target, moved)


def small_displacements(position: Floats, target: Floats, node: Ints) -> Floats:
    size = np.ptp(position[node], axis=1).max(axis=1)
    fraction = np.abs(target - position)[node].max(axis=(1, 2)) / size
    return np.where(fraction <= SMALL, fraction, 0.0)


def violating(position: Floats, node: Ints, least: Floats) -> Mask:
    found = qualities(position, node)
    return (found < least) | (found <= 0.0)


def qualities(position: Floats, node: Ints) -> Floats:
    return qualities_of(position.T[:, node.T])


def distances_from_faces(position: Floats, elements: Tetrahedra, patches: Patches) -> Floats:
    nodes, patch = faces_on_surfaces(elements, patches)
    corners = position[nodes]
    found = np.zeros(len(patches.shape))
    for x in (corners.mean(axis=1), *midpoints_of_edges(corners)):
        np.maximum.at(found, patch, np.linalg.norm(patches.project(patch, x) - x, axis=1))
    return found


def volume_cut_off(position: Floats, elements: Tetrahedra, patches: Patches) -> float:
    # Between the plane faces of elements and their surfaces, without sign. The integral of a quadratic function that
    # vanishes at the corners is a third of the area times the sum of the values at the midpoints of the edges.
    nodes, patch = faces_on_surfaces(elements, patches)
    x = midpoints_of_edges(position[nodes])
    off = np.sum([patches.project(patch, each) - each for each in x], axis=0)
    return float(np.sum(np.abs(np.sum(off * normals(position, nodes), axis=1))) / 6.0)


def faces_on_surfaces(elements: Tetrahedra, patches: Patches) -> IntsPair:
    # nodes (f, 3) of the faces on patches that are not plane, and their patches
    e, k = faces_on(elements, patches.moves)
    return faces_of(elements, e, k), elements.patch[e, k]


def midpoints_of_edges(corners: Floats) -> Floats:
    return 0.5 * (corners + np.roll(corners, 1, axis=1)).transpose(1, 0, 2)


def samples_of(faces: Faces, patches: Patches, position: Floats) -> Samples:
    if not np.any(patches.shape == PROJECTED):
        return NO_SAMPLES
    start = np.zeros(len(patches.shape) + 1, np.int32)
    samples = []
    for p in np.flatnonzero(patches.shape == PROJECTED).tolist():
        own = np.flatnonzero(patches.of_face == p)
        corners = position[faces.nodes[own]]
        out = out_of(faces, patches, own, position)
        point, face = lattice(corners)
        found = shapes_at(patches, p, point, corners[face], out[face])
        order = in_tree(found[0])
        samples.append([array[order] for array in found])
        start[p + 1] = len(order)
    return Samples(np.cumsum(start, dtype=np.int32), *map(np.concatenate, zip(*samples, strict=True)))


def out_of(faces: Faces, patches: Patches, own: Ints, position: Floats) -> Floats:
    normal = normals(position, faces.nodes[own])
    away = patches.in_front(patches.of_face[own], faces.regions[own, 0], position, faces.nodes[own])
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
    tree = np.empty(0, np.int64)
    for level in range(depth):
        block = rows.reshape(2**level, -1)
        block = np.take_along_axis(block, np.argsort(point[block, level % 3], axis=1, kind="stable"), axis=1)
        half = block.shape[1] // 2
        tree = np.append(tree, block[:, half])
        rows = np.delete(block, half, axis=1).ravel()
    return tree
