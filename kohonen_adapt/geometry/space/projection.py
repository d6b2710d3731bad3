"""Projection of the nodes of tetrahedra onto patches and ridges."""

import numpy as np

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.space.patches import Patches, onto_all
from kohonen_adapt.kernels.tetrahedron.arrays import CIRCLE, LINE, ON_PATCH, ON_RIDGE, Freedom, Surfaces, Tetrahedra
from kohonen_adapt.mesh.cells import TETRAHEDRON
from kohonen_adapt.mesh.tetrahedralization import FACES

__all__ = ["distances_from_faces", "move_to_targets", "projected_positions"]

STILL = 1e-13  # distance from the target below which nodes are not moved, relative to the size of the mesh
HALVINGS = 4  # maximum number of halvings of displacements that violate the quality rule
SMALL = 1e-4  # maximum size of a small displacement, relative to the element


def projected_positions(position: Floats, surfaces: Surfaces, freedom: Freedom, patches: Patches) -> Floats:
    x = position.copy()
    on = np.flatnonzero(freedom.number == ON_PATCH)
    on = on[patches.moves[freedom.place[on]]]
    x[on] = patches.project(freedom.place[on], x[on])
    on = np.flatnonzero(freedom.number == ON_RIDGE)
    ridge = freedom.place[on]
    meets = surfaces.meets[ridge]
    bound = np.any((meets >= 0) & np.append(patches.moves, False)[meets], axis=1) | (
        surfaces.ridge_shape[ridge] != LINE
    )
    on, ridge, meets = on[bound], ridge[bound], meets[bound]
    turns = [(on[meets[:, k] >= 0], meets[meets[:, k] >= 0, k]) for k in range(meets.shape[1])]
    x[on] = onto_all(turns, patches, x)[on]
    plain = np.flatnonzero((surfaces.ridge_shape[ridge] == LINE) | (surfaces.ridge_shape[ridge] == CIRCLE))
    x[on[plain]] = onto_ridges(x[on[plain]], ridge[plain], surfaces)
    return x


def onto_ridges(x: Floats, ridge: Ints, surfaces: Surfaces) -> Floats:
    origin, axis = surfaces.ridge_origin[ridge], surfaces.ridge_axis[ridge]
    along = axis * np.sum((x - origin) * axis, axis=1, keepdims=True)
    out = x - origin - along
    length = np.linalg.norm(out, axis=1, keepdims=True)
    on_circle = origin + out * (surfaces.ridge_size[ridge, None] / np.where(length > 0.0, length, 1.0))
    return np.where((surfaces.ridge_shape[ridge] == LINE)[:, None], origin + along, on_circle)


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
    corners = position.T[:, node.T]
    volume = TETRAHEDRON.determinant(corners) / 6.0
    squares = np.zeros(len(node))
    for a, b in TETRAHEDRON.edges:
        squares += np.sum((corners[:, a] - corners[:, b]) ** 2, axis=0)
    return TETRAHEDRON.regular * np.sign(volume) * np.abs(volume) ** (2.0 / 3.0) / squares


def distances_from_faces(position: Floats, elements: Tetrahedra, patches: Patches) -> Floats:
    found = np.zeros(len(patches.shape))
    used = elements.node[:, 0] >= 0
    e, k = np.nonzero((elements.patch >= 0) & used[:, None] & np.append(patches.moves, False)[elements.patch])
    corners = position[np.take_along_axis(elements.node[e], FACES[k], axis=1)]
    patch = elements.patch[e, k]
    edges = 0.5 * (corners + np.roll(corners, 1, axis=1))
    for x in (corners.mean(axis=1), *edges.transpose(1, 0, 2)):
        np.maximum.at(found, patch, np.linalg.norm(patches.project(patch, x) - x, axis=1))
    return found
