"""Merging of two meshes along a shared boundary, with the names of both."""

from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.spatial import KDTree
from skfem import Mesh, MeshTri
from skfem.generic_utils import OrientedBoundary

from kohonen_adapt.arrays import Floats, Ints, IntsPair, Mask
from kohonen_adapt.checks import is_number, point_text
from kohonen_adapt.mesh.cells import cell_of, centroids_of, determinants, width_of
from kohonen_adapt.mesh.curved import corners_of, midside_offsets, with_midside_offsets
from kohonen_adapt.mesh.host import facets_opposite, number_facets, remade, set_boundaries
from kohonen_adapt.mesh.locate import find_elements
from kohonen_adapt.mesh.measures import directed
from kohonen_adapt.mesh.names import boundary_of, named_sets
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["Sides", "boundary_facets", "merge", "sides_of", "with_images"]

Part = TypeVar("Part")

BESIDE = 0.2  # maximum distance of a curve from its chord, relative to the chord
OPPOSITE = -0.5  # maximum cosine of the angle between boundaries along each other, each counter-clockwise


class Sides(NamedTuple):
    """Facets of a boundary as sides of elements.

    This form stays valid if nodes and facets are renumbered.
    """

    element: Ints  # (k,); a facet between two elements appears with both
    corner: Ints  # (k,): row of mesh.t with the node opposite to the facet
    oriented: bool  # True if the first of both sides gives the orientation


def merge(one: MeshTri, other: MeshTri, *, rtol: float = 1e-6) -> MeshTri:
    """Join two meshes along the boundary that they share.

    For instance a rotor and a stator that were meshed separately. Coinciding boundary nodes are merged, at their
    position in the first mesh.

    Parameters
    ----------
    one, other
        Triangular meshes that share a boundary, or parts of a boundary, with the same nodes, and do not overlap. On
        shared sides of `skfem.MeshTri2` the midside nodes of `other` are kept.
    rtol
        Tolerance for coinciding nodes, relative to the largest extent of both meshes.

    Returns
    -------
    MeshTri
        The elements and nodes of `one`, followed by those of `other` except merged nodes. A subdomain or boundary
        contains the elements or facets with its name in both meshes. Boundaries that are oriented in every mesh with
        their name stay oriented.

    Raises
    ------
    ValueError
        If the nodes of the shared boundary differ (with the largest distance), if no facet is shared, if the meshes
        overlap, or if a mesh is invalid.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> left = skfem.MeshTri().refined(2).with_subdomains({"left": lambda x: x[0] > -1})
    >>> right = skfem.MeshTri().refined(2).translated((1.0, 0.0)).with_subdomains({"right": lambda x: x[0] > -1})
    >>> both = ka.merge(left, right)
    >>> both.p.shape[1], both.t.shape[1], sorted(both.subdomains)  # 5 of 2 x 25 nodes are shared
    (45, 64, ['left', 'right'])
    """
    for each in (one, other):
        check_mesh(each, space=False)
    offset = np.concatenate([midside_offsets(each) for each in (one, other)], axis=2)
    one, other = corners_of(one), corners_of(other)
    if not is_number(rtol) or not 0.0 <= rtol < 1.0:
        raise ValueError(f"rtol must be a number from 0 to below 1; got {rtol!r}.")
    near = rtol * max(width_of(mesh) for mesh in (one, other))
    nodes, others = same_nodes(one, other, near)
    check_same_nodes(one, other, nodes, others, near)
    check_apart(one, other)
    check_shared(one, other, nodes, others, near)
    first, elements = one.nvertices, one.nelements
    image = np.arange(first + other.nvertices)
    image[first + others] = nodes
    parts = [(one, 0), (other, elements)]
    subdomains = [{name: rows + k for name, rows in named_sets(mesh.subdomains).items()} for mesh, k in parts]
    sides = [{name: sides_of(mesh, rows, k) for name, rows in (mesh.boundaries or {}).items()} for mesh, k in parts]
    p, t = np.hstack([one.p, other.p]), np.hstack([one.t, other.t + first])
    return with_images(one, p, t, image, united(subdomains, np.concatenate), united(sides, together), offset)


def with_images(
    host: MeshTri,
    p: Floats,
    t: Ints,
    image: Ints,
    subdomains: Mapping[str, Ints],
    sides: Mapping[str, Sides],
    offset: Floats,
) -> MeshTri:
    """Return a mesh in which every node is replaced by its `image` (n,).

    `offset` (2, 3, m) contains the midside offsets of the sides opposite to the corners of `t`; if two elements share a
    facet, the later element counts.
    """
    unique_nodes, number = np.unique(image, return_inverse=True)
    elements, position = number[t].astype(host.t.dtype), np.ascontiguousarray(p[:, unique_nodes])
    mesh = remade(host, position, elements, boundaries=None, subdomains=dict(subdomains) or None)
    facet = facets_opposite(mesh, elements.T)  # scikit-fem may have reordered the corners
    if sides:
        found = {}
        for name, (element, corner, oriented) in sides.items():
            found[name] = boundary_of(mesh, facet, element, corner, np.ones_like(element, bool) if oriented else None)
        set_boundaries(mesh, found)
    if not offset.any():
        return mesh
    of_facet = np.zeros(mesh.facets.shape)
    of_facet[:, facet] = offset.swapaxes(1, 2)
    return with_midside_offsets(mesh, of_facet)


def sides_of(mesh: Mesh, rows: Ints, first: int = 0) -> Sides:
    number_facets(mesh)
    facet = np.asarray(rows, np.int64)
    meant = getattr(rows, "ori", np.zeros_like(facet))
    facet, element = np.tile(facet, 2), np.concatenate([mesh.f2t[side, facet] for side in (meant, 1 - meant)])
    facet, element = facet[element >= 0], element[element >= 0]
    corner = np.array(cell_of(mesh).opposite)[np.argmax(mesh.t2f[:, element] == facet, axis=0)]
    return Sides(element + first, corner, isinstance(rows, OrientedBoundary))


def together(parts: list[Sides]) -> Sides:
    element, corner = (np.concatenate([getattr(part, name) for part in parts]) for name in ("element", "corner"))
    return Sides(element, corner, all(part.oriented for part in parts))


def united(parts: list[dict[str, Part]], join: Callable[[list[Part]], Part]) -> dict[str, Part]:
    names = dict.fromkeys(name for part in parts for name in part)
    return {name: join([part[name] for part in parts if name in part]) for name in names}


def boundary_facets(mesh: MeshTri) -> Ints:
    # counter-clockwise, (2, nfacets)
    number_facets(mesh)
    facet = np.flatnonzero(mesh.f2t[1] < 0)
    return directed(mesh, facet).T


def nearest(mesh: MeshTri, x: Floats) -> tuple[Floats, Ints]:
    # distances of points from the nearest nodes on the boundary, and these nodes
    nodes = np.unique(boundary_facets(mesh))
    distance, at = KDTree(mesh.p[:, nodes].T).query(x.T)
    return distance, nodes[at]


def same_nodes(one: MeshTri, other: MeshTri, near: float) -> IntsPair:
    others = np.unique(boundary_facets(other))
    distance, nodes = nearest(one, other.p[:, others])
    nodes, others = nodes[distance <= near], others[distance <= near]
    if len(np.unique(nodes)) < len(nodes):
        raise ValueError(
            f"nodes nearer to one another than {near:.6g} become one, but outlines have several there. Give a smaller "
            "rtol, or merge the nodes of each mesh that are in one place."
        )
    return nodes, others


def check_same_nodes(one: MeshTri, other: MeshTri, nodes: Ints, others: Ints, near: float) -> None:
    farthest, place = -1.0, ""
    for mesh, shared, neighbour in ((one, nodes, other), (other, others, one)):
        alone = np.setdiff1d(boundary_facets(mesh), shared)
        x = mesh.p[:, alone[along_boundary(mesh, alone, neighbour)]]
        if x.size:
            distance, _ = nearest(neighbour, x)
            farthest, place = max((farthest, place), (float(distance.max()), point_text(x[:, np.argmax(distance)])))
    if farthest >= 0.0:
        raise ValueError(
            f"the outline that the meshes share must have the same nodes in both, within {near:.6g} (rtol); the "
            f"farthest, at {place}, is {farthest:.6g} from the nearest node of the other mesh. Mesh it with "
            "the same divisions on both sides, and turn parts by whole steps of them (kohonen_adapt.turned)."
        )


def check_shared(one: MeshTri, other: MeshTri, nodes: Ints, others: Ints, near: float) -> None:
    partner = np.full(other.nvertices, -1)
    partner[others] = nodes
    (a, b), (start, end), count = boundary_facets(one), partner[boundary_facets(other)], one.nvertices
    shared = (end * count + start)[np.minimum(start, end) >= 0]
    if not np.isin(shared, a * count + b).any():  # in opposite directions
        distance, _ = nearest(one, other.p[:, np.unique(boundary_facets(other))])
        raise ValueError(
            f"the meshes must share an outline, facet by facet; they share none, and the nearest of their nodes are "
            f"{distance.min():.6g} apart, where {near:.6g} is allowed (rtol). Move or scale one, or give another rtol."
        )


def along_boundary(mesh: MeshTri, nodes: Ints, other: MeshTri) -> Mask:
    """Return a mask of `nodes` that lie along the boundary of `other`, (k,).

    A node lies along a facet if it is within half the length of the facet from its midpoint and near the line through
    the facet, which may be the chord of a curve. The boundaries, both counter-clockwise, must run in opposite
    directions there, which excludes nodes at which they only touch.
    """
    ends, tangent = boundary_facets(mesh), np.zeros_like(mesh.p)
    np.add.at(tangent.T, ends, np.diff(mesh.p.T[ends], axis=0))
    a, b = other.p[:, boundary_facets(other)].swapaxes(0, 1)
    along, middle = b - a, 0.5 * (a + b)
    length = np.hypot(*along)
    found = np.zeros(len(nodes), bool)
    if not nodes.size:
        return found
    lists = KDTree(mesh.p[:, nodes].T).query_ball_point(middle.T, 0.5 * length)
    facet, row = np.repeat(np.arange(len(lists)), list(map(len, lists))), np.concatenate(lists).astype(int)
    along, tangent = along[:, facet] / length[facet], tangent[:, nodes[row]]
    relative = mesh.p[:, nodes[row]] - middle[:, facet]
    near = np.abs(determinants((along, relative))) < BESIDE * length[facet]
    found[row[near & (np.sum(along * tangent, axis=0) < OPPOSITE * np.hypot(*tangent))]] = True
    return found


def check_apart(one: MeshTri, other: MeshTri) -> None:
    for mesh, neighbour, words in ((one, other, "second"), (other, one, "first")):
        centroids = centroids_of(neighbour)
        inside = np.flatnonzero(find_elements(mesh, centroids) >= 0)
        if inside.size:
            raise ValueError(
                f"the meshes overlap: {inside.size} elements of the {words} have their middle in the other, the first "
                f"at {point_text(centroids[:, inside[0]])}. Move one, or cut out what they both have."
            )
