"""Geometric layers of triangles around nodes where a field is singular."""

from collections.abc import Mapping, Sequence

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.pieces import Pieces, curved_mesh, mesh_of, sides_in_parent
from kohonen_adapt.geometry.plane.curves import Curve
from kohonen_adapt.geometry.plane.pairs import image_nodes
from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.host import facets_opposite
from kohonen_adapt.mesh.motions import Pair

__all__ = ["with_corner_layers"]


Corner = tuple[Ints, Floats]  # (r,) nodes and (r, 3) barycentric coordinates in the parents


def with_corner_layers(
    mesh: MeshTri,
    singular: Mask,
    layers: int,
    factor: float,
    periodic: Sequence[Pair],
    curves: Mapping[str, Curve] | None,
) -> MeshTri:
    shape = Blended(mesh, {name: curve.project for name, curve in (curves or {}).items()})
    singular = with_images(singular, shape.corners, periodic)
    pieces = separated(Pieces.of(shape.t), singular)
    for _ in range(layers):
        pieces = with_layer(pieces, singular, factor)
    made = mesh_of(pieces, mesh, shape)
    return with_curved_sides(made, pieces, shape) if shape.curved.any() else made


def with_images(singular: Mask, mesh: MeshTri, periodic: Sequence[Pair]) -> Mask:
    while periodic:
        before = singular.copy()
        for nodes, images in image_nodes(mesh, periodic):
            singular[nodes] = singular[images] = singular[nodes] | singular[images]
        if np.array_equal(before, singular):
            break
    return singular


def is_singular(node: Ints, singular: Mask) -> Mask:
    return (node < singular.size) & singular[np.minimum(node, singular.size - 1)]


def separated(pieces: Pieces, singular: Mask) -> Pieces:
    node, share, at = pieces.node, pieces.share, is_singular(pieces.node, singular)
    both, halves = at[:, AFTER] & at[:, BEFORE], 0.5 * (share[:, AFTER] + share[:, BEFORE])
    middle = np.full(node.shape, -1)
    middle[both] = new_nodes(node[:, AFTER][both], node[:, BEFORE][both], node)
    one, three = np.flatnonzero(both.sum(axis=1) == 1), np.flatnonzero(both.all(axis=1))
    k = np.argmax(both[one], axis=1)
    opposite, after, before = ((node[one, (k + i) % 3], share[one, (k + i) % 3]) for i in range(3))
    half = middle[one, k], halves[one, k]
    corner = [(node[three, i], share[three, i]) for i in range(3)]
    inner = [(middle[three, i], halves[three, i]) for i in range(3)]
    quarters = [[corner[i], inner[BEFORE[i]], inner[AFTER[i]]] for i in range(3)]
    return divided(pieces, (one, [[opposite, after, half], [opposite, half, before]]), (three, [*quarters, inner]))


def with_layer(pieces: Pieces, singular: Mask, factor: float) -> Pieces:
    e, k = np.nonzero(is_singular(pieces.node, singular))
    (v, at_v), (a, at_a), (b, at_b) = ((pieces.node[e, (k + i) % 3], pieces.share[e, (k + i) % 3]) for i in range(3))
    near = new_nodes(np.append(v, v), np.append(a, b), pieces.node).reshape(2, -1)
    near_a, near_b = (near[0], at_v + factor * (at_a - at_v)), (near[1], at_v + factor * (at_b - at_v))
    far_a, far_b = (a, at_a), (b, at_b)
    return divided(pieces, (e, [[(v, at_v), near_a, near_b], [near_a, far_a, far_b], [near_a, far_b, near_b]]))


def new_nodes(start: Ints, end: Ints, node: Ints) -> Ints:
    count = int(node.max(initial=-1)) + 1
    low, high = np.minimum(start, end), np.maximum(start, end)
    return count + np.unique(low * count + high, return_inverse=True)[1].ravel()


def divided(pieces: Pieces, *groups: tuple[Ints, list[list[Corner]]]) -> Pieces:
    # Replace rows by parts, each given by three corners of all rows.
    parts = [
        Pieces(
            np.stack([numbers for numbers, _ in corners], axis=1),
            pieces.parent[rows],
            np.stack([coordinates for _, coordinates in corners], axis=1),
        )
        for rows, triangles in groups
        for corners in triangles
    ]
    return pieces.replaced(np.concatenate([rows for rows, _ in groups]), parts)


def with_curved_sides(made: MeshTri, pieces: Pieces, shape: Blended) -> MeshTri:
    facet = facets_opposite(made, pieces.node.astype(np.int32))
    e, k = np.nonzero(sides_in_parent(pieces.share).any(axis=2) & shape.curved[pieces.parent][:, None])
    ends = [pieces.share[e, np.take(ways, k)] for ways in (AFTER, BEFORE)]
    midside = shape.points(pieces.parent[e], 0.5 * (ends[0] + ends[1]).T)
    offset = np.zeros((2, made.facets.shape[1]))
    offset[:, facet[e, k]] = midside - made.p[:, made.facets[:, facet[e, k]]].mean(axis=1)
    return curved_mesh(made, offset, pieces, shape)
