"""Geometric layers of triangles around nodes where a field is singular."""

from collections.abc import Sequence

import numpy as np
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.geometry.pieces import FoldedLayers, Pieces, curved_mesh, mesh_of, sides_in_parent
from kohonen_adapt.geometry.plane.curves import Curves
from kohonen_adapt.geometry.plane.pairs import image_nodes
from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.curved import AFTER, BEFORE
from kohonen_adapt.mesh.host import ascending, facets_opposite, keys_of
from kohonen_adapt.mesh.motions import Pair

__all__ = ["with_corner_layers"]

HALVINGS = 3  # maximum number of times that curved sides of elements with inverted parts are halved

Corner = tuple[Ints, Floats]  # (r,) nodes and (r, 3) barycentric coordinates in the parents


def with_corner_layers(
    mesh: MeshTri,
    singular: Mask,
    layers: int,
    factor: float,
    periodic: Sequence[Pair],
    curves: Curves | None,
    halvings: int = HALVINGS,
) -> MeshTri:
    shape = Blended(mesh, {name: curve.project for name, curve in (curves or {}).items()})
    singular = with_images(singular, shape.corners, periodic)
    pieces = separated(Pieces.of(shape.t), singular)
    for _ in range(layers):
        pieces = with_layer(pieces, singular, factor)
    try:
        return made_of(pieces, mesh, shape)
    except FoldedLayers as error:
        # Curved sides bend by more than the layers are thick; their halves bend by a quarter.
        finer = with_halved_sides(mesh, shape, error.elements, periodic) if halvings else None
        if finer is None:
            raise
    more = np.append(singular, np.zeros(finer.nvertices - singular.size, bool))
    return with_corner_layers(finer, more, layers, factor, periodic, curves, halvings - 1)


def made_of(pieces: Pieces, mesh: MeshTri, shape: Blended) -> MeshTri:
    made = mesh_of(pieces, mesh, shape)
    return with_curved_sides(made, pieces, shape) if shape.curved.any() else made


def with_halved_sides(mesh: MeshTri, shape: Blended, elements: Ints, periodic: Sequence[Pair]) -> MeshTri | None:
    # with halves of the curved sides of elements, or None if these would be inverted
    marked = np.zeros(shape.corners.facets.shape[1], bool)
    marked[shape.corners.t2f[:, elements]] = True
    marked = with_image_sides(marked & shape.side_offset.any(axis=0), shape.corners, periodic)
    whole = Pieces.of(shape.t)
    try:
        return made_of(halved(whole, marked[facets_opposite(shape.corners, whole.node)]), mesh, shape)
    except FoldedLayers:
        return None


def with_image_sides(marked: Mask, mesh: MeshTri, periodic: Sequence[Pair]) -> Mask:
    facets, count = mesh.facets, mesh.nvertices
    for nodes, images in image_nodes(mesh, periodic) if periodic else ():
        image = np.arange(count)
        image[nodes], image[images] = images, nodes
        moved = ascending(*image[facets[:, marked]])
        marked = marked | np.isin(keys_of(facets, count), keys_of(moved, count))
    return marked


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
    at = is_singular(pieces.node, singular)
    return halved(pieces, at[:, AFTER] & at[:, BEFORE])


def halved(pieces: Pieces, marked: Mask) -> Pieces:
    # with halves of the sides opposite to marked corners (m, 3)
    node = pieces.node
    share = pieces.share
    count = marked.sum(axis=1)
    halves = 0.5 * (share[:, AFTER] + share[:, BEFORE])
    middle = np.full(node.shape, -1)
    middle[marked] = new_nodes(node[:, AFTER][marked], node[:, BEFORE][marked], node)

    def corners(rows: Ints, first: Ints) -> tuple[list[Corner], list[Corner]]:
        # corners of the rows, from `first` on, and the middles of the sides opposite to these
        turned = [(first + i) % 3 for i in range(3)]
        return [(node[rows, k], share[rows, k]) for k in turned], [(middle[rows, k], halves[rows, k]) for k in turned]

    one, two, three = (np.flatnonzero(count == k) for k in (1, 2, 3))
    (top, after, before), (half, _, _) = corners(one, np.argmax(marked[one], axis=1))
    single = [[top, after, half], [top, half, before]]
    (apex, left, right), (_, to_right, to_left) = corners(two, np.argmin(marked[two], axis=1))
    double = [[apex, to_left, to_right], [to_left, left, right], [to_left, right, to_right]]
    corner, inner = corners(three, np.zeros_like(three))
    quarters = [[corner[i], inner[BEFORE[i]], inner[AFTER[i]]] for i in range(3)]
    return divided(pieces, (one, single), (two, double), (three, [*quarters, inner]))


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
