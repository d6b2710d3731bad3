"""Geometric layers of elements around nodes where a field is singular."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import is_count, is_number
from kohonen_adapt.geometry.plane.curves import Curve
from kohonen_adapt.geometry.plane.pairs import image_nodes
from kohonen_adapt.mesh.blended import Blended
from kohonen_adapt.mesh.curved import AFTER, BEFORE, inverted_elements, with_midside_offsets
from kohonen_adapt.mesh.host import facets_opposite, set_boundaries
from kohonen_adapt.mesh.joining import sides_of
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["FACTOR", "RESOLVED", "FoldedLayers", "refined_at", "size_at", "with_layers"]

FACTOR = 0.15  # ratio of the sizes of successive layers
RESOLVED = 1e-14  # size of elements that coordinates resolve, relative to the coordinates

logger = logging.getLogger("kohonen_adapt")


class FoldedLayers(ValueError):
    """Layers would invert elements at a curve.

    Attributes
    ----------
    nodes
        Corners of these elements in the mesh without layers.
    """

    def __init__(self, nodes: Ints) -> None:
        self.nodes = nodes
        super().__init__(
            "layers at the nodes would invert elements at a curve, because its facets turn too far. Refine the mesh "
            "along the curve first, or leave out the nodes at its ends."
        )


class Pieces(NamedTuple):
    node: Ints  # (m, 3): corners; new nodes follow the nodes of the mesh
    parent: Ints  # (m,): element that the part lies in
    share: Floats  # (m, 3, 3): barycentric coordinates of the corners in the parent

    def divided(self, *groups: tuple[Ints, list[list["Corner"]]]) -> "Pieces":
        # Replace rows by parts, each given by three corners of all rows.
        kept = np.delete(np.arange(len(self.node)), np.concatenate([rows for rows, _ in groups]))
        node, parent, share = [self.node[kept]], [self.parent[kept]], [self.share[kept]]
        for rows, parts in groups:
            for corners in parts:
                node.append(np.stack([numbers for numbers, _ in corners], axis=1))
                share.append(np.stack([coordinates for _, coordinates in corners], axis=1))
                parent.append(self.parent[rows])
        return Pieces(np.concatenate(node), np.concatenate(parent), np.concatenate(share))


Corner = tuple[Ints, Floats]  # (r,) nodes and (r, 3) barycentric coordinates in the parents


def refined_at(
    mesh: MeshTri,
    nodes: ArrayLike,
    *,
    layers: int = 2,
    factor: float = FACTOR,
    periodic: Sequence[Pair] = (),
    curves: Mapping[str, Curve] | None = None,
) -> MeshTri:
    """Refine a mesh geometrically towards nodes, for elements of high order.

    A layer divides every element at a node v into the part next to v, smaller by `factor`, and two elements behind it.
    On meshes with such layers the error of high orders falls exponentially although the field is singular at the nodes
    (B. Guo and I. Babuska, Comput. Mech. 1, 1986). The side of an element between two of the nodes is halved first.

    Parameters
    ----------
    mesh
        Triangles, not modified. On the curved sides of a `skfem.MeshTri2` new nodes lie on the arcs or parabolas.
    nodes
        Numbers of the nodes, shape (k,).
    layers
        Number of layers, at least 1.
    factor
        Ratio of the sizes of successive layers, between 0 and 1.
    periodic
        Pairs of boundaries as in `Rules.periodic`: layers at a node are made at its image, too.
    curves
        Curves of boundaries as in `Rules.curves`, on which new nodes of curved sides lie. Arcs need none.

    Returns
    -------
    MeshTri or MeshTri2
        The refined mesh. The nodes of `mesh` keep their numbers, subdomains and boundaries keep their names.

    Raises
    ------
    ValueError
        If an argument is out of range, if the mesh is invalid or of tetrahedra, if a pair does not match, or if layers
        would invert elements at a curve.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)
    >>> finer = ka.refined_at(mesh, [0], layers=2)
    >>> round(float(finer.p[0, finer.p[0] > 0.0].min()), 5)  # 0.5 times 0.15 squared
    0.01125
    """
    check_mesh(mesh, curved=True)
    if not is_count(layers) or layers < 1:
        raise ValueError(f"layers must be an integer >= 1; got {layers!r}.")
    if not is_number(factor) or not 0.0 < factor < 1.0:
        raise ValueError(f"factor must be a number between 0 and 1; got {factor!r}.")
    shape = Blended(mesh, {name: curve.project for name, curve in (curves or {}).items()})
    singular = with_images(checked_nodes(nodes, shape.p.shape[1]), shape.corners, periodic)
    count = shape.t.shape[1]
    whole = Pieces(shape.t.T.astype(np.int64), np.arange(count), np.tile(np.eye(3), (count, 1, 1)))
    pieces = separated(whole, singular)
    for _ in range(layers):
        pieces = with_layer(pieces, singular, float(factor))
    return mesh_of(pieces, mesh, shape)


def with_layers(
    mesh: MeshTri, nodes: Ints, layers: int, periodic: Sequence[Pair], curves: Mapping[str, Curve] | None = None
) -> tuple[MeshTri, Ints]:
    """Return a new mesh with layers, and the nodes that have them.

    Nodes at curves get none if their layers would invert elements, and nodes with elements so small that coordinates
    do not resolve their layers get none either.
    """
    resolved = np.array(
        [size_at(mesh, node) * FACTOR**layers > RESOLVED * np.hypot(*mesh.p[:, node]) for node in nodes]
    )
    nodes = nodes[resolved] if nodes.size else nodes
    while nodes.size:
        try:
            return refined_at(mesh, nodes, layers=layers, periodic=periodic, curves=curves), nodes
        except FoldedLayers as error:
            kept = np.setdiff1d(nodes, error.nodes)
            logger.info("%d corners at curves get no layers", nodes.size - kept.size)
            nodes = kept if kept.size < nodes.size else nodes[:0]
    return replace(mesh), nodes  # a pass is known by its mesh


def size_at(mesh: MeshTri, node: int) -> float:
    star = mesh.t[:, np.any(mesh.t == node, axis=0)]
    return float(np.hypot(*(mesh.p[:, star[star != node]] - mesh.p[:, [node]])).min())


def checked_nodes(nodes: ArrayLike, count: int) -> Mask:
    rows, chosen = np.asarray(nodes), np.zeros(count, dtype=np.bool_)
    if rows.size and (rows.ndim != 1 or rows.dtype.kind not in "iu"):
        advice = " Take np.flatnonzero(mask) of a mask." if rows.dtype.kind == "b" else ""
        raise ValueError(f"nodes must be whole numbers, shape (k,); got {rows.dtype} of shape {rows.shape}.{advice}")
    outside = rows[(rows < 0) | (rows >= count)]
    if outside.size:
        raise ValueError(f"nodes must be numbers of nodes of this mesh, from 0 to {count - 1}; got {outside[0]}.")
    chosen[rows.astype(np.int64)] = True
    return chosen


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
    return pieces.divided((one, [[opposite, after, half], [opposite, half, before]]), (three, [*quarters, inner]))


def with_layer(pieces: Pieces, singular: Mask, factor: float) -> Pieces:
    e, k = np.nonzero(is_singular(pieces.node, singular))
    (v, at_v), (a, at_a), (b, at_b) = ((pieces.node[e, (k + i) % 3], pieces.share[e, (k + i) % 3]) for i in range(3))
    near = new_nodes(np.append(v, v), np.append(a, b), pieces.node).reshape(2, -1)
    near_a, near_b = (near[0], at_v + factor * (at_a - at_v)), (near[1], at_v + factor * (at_b - at_v))
    far_a, far_b = (a, at_a), (b, at_b)
    return pieces.divided((e, [[(v, at_v), near_a, near_b], [near_a, far_a, far_b], [near_a, far_b, near_b]]))


def new_nodes(start: Ints, end: Ints, node: Ints) -> Ints:
    count = int(node.max(initial=-1)) + 1
    low, high = np.minimum(start, end), np.maximum(start, end)
    return count + np.unique(low * count + high, return_inverse=True)[1].ravel()


def mesh_of(pieces: Pieces, mesh: MeshTri, shape: Blended) -> MeshTri:
    count, old = int(pieces.node.max()) + 1, shape.p.shape[1]
    p = np.empty((2, count))
    p[:, :old] = shape.p
    number, first = np.unique(pieces.node.ravel(), return_index=True)
    number, first = number[number >= old], first[number >= old]
    p[:, number] = shape.points(pieces.parent[first // 3], pieces.share.reshape(-1, 3)[first].T)
    made = MeshTri(p, np.ascontiguousarray(pieces.node.T))
    made = made.with_subdomains(
        {name: np.flatnonzero(np.isin(pieces.parent, rows)) for name, rows in (mesh.subdomains or {}).items()}
    )
    facet, on_side = facets_opposite(made, pieces.node.astype(np.int32)), sides_in_parent(pieces.share)
    if mesh.boundaries is not None:
        args = made, facet, pieces.parent, on_side, shape.corners
        set_boundaries(made, {name: divided_boundary(*args, rows) for name, rows in mesh.boundaries.items()})
    if not shape.curved.any():
        return made
    e, k = np.nonzero(on_side.any(axis=2) & shape.curved[pieces.parent][:, None])
    ends = [pieces.share[e, np.take(ways, k)] for ways in (AFTER, BEFORE)]
    midside = shape.points(pieces.parent[e], 0.5 * (ends[0] + ends[1]).T)
    offset = np.zeros((2, made.facets.shape[1]))
    offset[:, facet[e, k]] = midside - made.p[:, made.facets[:, facet[e, k]]].mean(axis=1)
    curved = with_midside_offsets(made, offset)
    inverted = inverted_elements(curved)
    if inverted.size:
        raise FoldedLayers(np.unique(shape.t[:, pieces.parent[inverted]]))
    return curved


def sides_in_parent(share: Floats) -> Mask:
    # Return a mask of sides k that lie on sides j of the parents, (m, 3, 3).
    on = share == 0.0
    return on[:, AFTER] & on[:, BEFORE]


def divided_boundary(mesh: MeshTri, facet: Ints, parent: Ints, on_side: Mask, before: MeshTri, rows: Ints) -> Ints:
    sides = sides_of(before, rows)
    meant = len(rows) if sides.oriented else len(sides.element)  # `sides_of` lists the oriented side first
    named = np.zeros((before.t.shape[1], 3), dtype=np.bool_)
    named[sides.element[:meant], sides.corner[:meant]] = True
    e, k = np.nonzero(np.any(on_side & named[parent][:, None], axis=2))
    number, first = np.unique(facet[e, k], return_index=True)
    if not sides.oriented:
        return number
    return OrientedBoundary(number, (mesh.f2t[0, number] != e[first]).astype(np.int64))
