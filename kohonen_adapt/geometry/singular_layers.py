"""Geometric layers of elements at singular nodes and edges."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import check_count, is_number
from kohonen_adapt.geometry.pieces import FoldedLayers
from kohonen_adapt.geometry.plane.corner_layers import with_corner_layers
from kohonen_adapt.geometry.plane.curves import Curves
from kohonen_adapt.geometry.space.edge_layers import with_edge_layers
from kohonen_adapt.log import logger
from kohonen_adapt.mesh.cells import cell_of
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.host import ascending, edges_between
from kohonen_adapt.mesh.measures import magnitude
from kohonen_adapt.mesh.motions import Pair
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["FACTOR", "RESOLVED", "refined_at", "sizes_at", "with_layers_at"]

FACTOR = 0.15  # ratio of the sizes of successive layers
RESOLVED = 1e-14  # size of elements that coordinates resolve, relative to the coordinates


def refined_at(
    mesh: Mesh,
    nodes: ArrayLike = (),
    *,
    edges: ArrayLike = (),
    layers: int = 2,
    factor: float = FACTOR,
    periodic: Sequence[Pair] = (),
    curves: Curves | None = None,
) -> Mesh:
    """Refine a mesh geometrically towards nodes and edges, for high orders.

    A layer divides every element at a node v into the part next to v, smaller by `factor`, and two elements behind it,
    three in space. An element at an edge is divided into six for each layer. On meshes with such layers the error of
    high orders falls exponentially although the field is singular at the nodes (B. Guo and I. Babuska, Comput. Mech. 1,
    1986). The side of an element between two of the nodes is halved first, in space unless it is one of `edges`. In the
    plane curved sides are halved, too, where layers would invert elements otherwise.

    Parameters
    ----------
    mesh
        Triangles or tetrahedra, not modified. New nodes lie on the curved sides of a `skfem.MeshTri2`, arcs or
        parabolas, and on those of a `MeshTet2`.
    nodes
        Numbers of the nodes, shape (k,).
    edges
        In space, the two nodes of each singular edge, shape (2, k), for instance columns of ``mesh.edges``. Their nodes
        need not be among `nodes`.
    layers
        Number of layers, at least 1.
    factor
        Ratio of the sizes of successive layers, between 0 and 1.
    periodic
        In the plane, pairs of boundaries as in `Rules.periodic`: layers at a node are made at its image, too.
    curves
        In the plane, curves of boundaries as in `Rules.curves`, on which new nodes of curved sides lie. Arcs need none.

    Returns
    -------
    MeshTri, MeshTri2, MeshTet or MeshTet2
        The refined mesh. The nodes of `mesh` keep their numbers, subdomains and boundaries keep their names. Midside
        nodes follow the corners.

    Raises
    ------
    ValueError
        If an argument is out of range or not for this kind of mesh, if the mesh is invalid, if a pair does not match,
        or if layers would invert elements at a curve.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)
    >>> finer = ka.refined_at(mesh, [0], layers=2)
    >>> round(float(finer.p[0, finer.p[0] > 0.0].min()), 5)  # 0.5 times 0.15 squared
    0.01125
    >>> cube = skfem.MeshTet()
    >>> ka.refined_at(cube, edges=cube.edges[:, :1], layers=1).nelements > cube.nelements
    True
    """
    check_mesh(mesh)
    check_count("layers", layers, 1)
    if not is_number(factor) or not 0.0 < factor < 1.0:
        raise ValueError(f"factor must be a number between 0 and 1; got {factor!r}.")
    count = mesh.nvertices
    singular = np.zeros(count, bool)
    singular[node_numbers("nodes", nodes, (), count)] = True
    if len(mesh.p) == 2:
        if np.size(edges):
            raise ValueError("edges are for tetrahedra; give the nodes of triangles as nodes.")
        return with_corner_layers(mesh, singular, layers, float(factor), periodic, curves)
    if periodic or curves:
        raise ValueError("periodic and curves are for triangles; new nodes of a MeshTet2 lie on its curved edges.")
    ends = checked_edges(corners_of(mesh), node_numbers("edges", edges, (2,), count))
    return with_edge_layers(mesh, singular, ends, layers, float(factor))


def with_layers_at(
    mesh: Mesh,
    nodes: Ints,
    layers: int,
    periodic: Sequence[Pair] = (),
    curves: Curves | None = None,
    edges: Ints | None = None,
) -> tuple[Mesh, Ints]:
    """Return a new mesh with layers, and the nodes that have them.

    Nodes at curves get none if their layers would invert elements, and nodes with elements so small that coordinates
    do not resolve their layers get none either, nor do `edges` at these nodes.
    """
    resolved = sizes_at(mesh) * FACTOR**layers > RESOLVED * magnitude(mesh.p[:, : mesh.nvertices])
    nodes = nodes[resolved[nodes]]
    edges = np.zeros((2, 0), np.int64) if edges is None else edges[:, resolved[edges].all(axis=0)]
    while nodes.size or edges.size:
        try:
            made = refined_at(mesh, nodes, edges=edges, layers=layers, periodic=periodic, curves=curves)
        except FoldedLayers as error:
            kept = np.setdiff1d(nodes, error.nodes)
            apart = ~np.isin(edges, error.nodes).any(axis=0)
            logger.info("%d corners at curves get no layers", nodes.size - kept.size)
            none = kept.size == nodes.size and apart.all()
            nodes, edges = (kept[:0], edges[:, :0]) if none else (kept, edges[:, apart])
        else:
            return made, nodes
    return replace(mesh), nodes  # a pass is known by its mesh


def sizes_at(mesh: Mesh) -> Floats:
    """Return the length of the shortest edge at every node, (nnodes,)."""
    one, other = mesh.t[np.transpose(cell_of(mesh).edges)]
    length, size = magnitude(mesh.p[:, one] - mesh.p[:, other]), np.full(mesh.nvertices, np.inf)
    for ends in (one, other):
        np.minimum.at(size, ends, length)
    return size


def node_numbers(name: str, given: ArrayLike, before: tuple[int, ...], count: int) -> Ints:
    # of shape (*before, k)
    rows = np.asarray(given)
    if not rows.size:
        return np.zeros((*before, 0), np.int64)
    if rows.shape[:-1] != before or rows.ndim == 0 or rows.dtype.kind not in "iu":
        wanted = ", ".join(map(str, (*before, "k"))) + ","[: not before]
        advice = " Take np.flatnonzero(mask) of a mask." if rows.dtype.kind == "b" and not before else ""
        raise ValueError(
            f"{name} must be whole numbers, shape ({wanted}); got {rows.dtype} of shape {rows.shape}.{advice}"
        )
    outside = rows[(rows < 0) | (rows >= count)]
    if outside.size:
        raise ValueError(f"{name} must be numbers of nodes of this mesh, from 0 to {count - 1}; got {outside[0]}.")
    return rows.astype(np.int64)


def checked_edges(mesh: Mesh, ends: Ints) -> Ints:
    # each edge once
    ends = np.unique(ascending(*ends), axis=1)
    found = mesh.edges[:, np.minimum(edges_between(mesh, *ends), mesh.edges.shape[1] - 1)]
    none = np.flatnonzero(np.any(found != ends, axis=0))
    if none.size:
        one, other = ends[:, none[0]]
        raise ValueError(f"edges must be edges of the mesh; it has none between the nodes {one} and {other}.")
    return ends
