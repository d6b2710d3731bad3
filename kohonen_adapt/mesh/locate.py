"""Search for the elements that contain points, and interpolation at points."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Int32s, Ints, Mask
from kohonen_adapt.kernels.grid import Grid
from kohonen_adapt.kernels.numba.compilation import expect
from kohonen_adapt.kernels.search import barycentric, find, list_in_cells, walk_each
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.mesh.adjacency import BoxTree, parts_at, parts_of_regions
from kohonen_adapt.mesh.cells import cell_of, check_kind, corner_positions, width_of
from kohonen_adapt.mesh.curved import Isoparametric, check_curved_sides, is_second_order
from kohonen_adapt.mesh.tessellation import AnyTessellation
from kohonen_adapt.mesh.tetrahedralization import Tetrahedralization
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = [
    "TESSELLATIONS",
    "Locator",
    "barycentric_coordinates",
    "elements_at",
    "find_elements",
    "interpolate",
    "nearest_labelled",
    "walk_in_parts",
    "walk_to_elements",
]

FEW = 5_000  # minimum number of points per thread
CHUNK = 500_000  # points per compiled call, so that Ctrl-C takes effect within half a second
CACHED = 20_000  # number of elements whose data fit into the cache of a processor
NEAR = 1e-9  # of the size of the mesh or of an element, by which a point inside may lie outside by rounding errors

TESSELLATIONS: dict[int, type[AnyTessellation]] = {2: Triangulation, 3: Tetrahedralization}  # by dimension


class Locator:
    """Search for the elements that contain points.

    A regular grid gives a nearby element for every point, and a walk of a few steps finds the element from there. If a
    hole or a boundary blocks the walk, all elements that meet the grid cell are tested. The result is therefore exact
    on any domain. Later changes of the tessellation have no effect.
    """

    def __init__(self, tessellation: AnyTessellation) -> None:
        elements = tessellation.elements
        self.position, node = tessellation.position.copy(), elements.node.copy()
        self.elements = elements._replace(
            node=node, neighbour=elements.neighbour.copy(), region=np.zeros_like(elements.region)
        )
        grid = Grid.over(self.position, len(node) / tessellation.crowd)
        list_in_cells(self.position, node, grid, True)
        self.grid = grid._replace(content=np.empty(grid.start[-1], np.int32))
        list_in_cells(self.position, node, self.grid, False)

    def find(self, points: Floats) -> Int32s:
        found = np.empty(len(points), np.int32)
        for first in range(0, len(points), CHUNK):
            part = slice(first, first + CHUNK)
            order: Ints | slice = slice(None)
            if len(self.elements.node) > CACHED:
                order = np.argsort(self._cells(points[part]), kind="stable")  # for locality in memory
            found[part][order] = self._search(points[part][order])
        return found

    def _cells(self, points: Floats) -> Ints:
        cell = np.nan_to_num((points - self.grid.origin) / self.grid.size)
        inside = np.clip(cell, 0, self.grid.shape - 1).astype(np.int64)
        return np.ravel_multi_index(tuple(inside.T), tuple(self.grid.shape))

    def _search(self, points: Floats) -> Ints:
        found, origin = np.empty(len(points), np.int32), (0.0,) * points.shape[1]

        def task(thread: int, first: int, last: int) -> None:
            part = slice(first, last)
            find(self.position, self.elements, points[part], origin, self.grid, found[part])

        shared(task, even_cuts(len(points), FEW))
        return found

    def barycentric_coordinates(self, points: Floats, found: Ints) -> Floats:
        return barycentric_coordinates(self.position, self.elements.node, points, found)


def barycentric_coordinates(position: Floats, node: Ints, points: Floats, found: Ints) -> Floats:
    # (n, dim + 1), of points (n, dim) in the elements `found`
    out = np.empty((len(points), points.shape[1] + 1))
    barycentric(position, node, points, (0.0,) * points.shape[1], found, out)
    return out


def walk_to_elements(tessellation: AnyTessellation, points: Floats, start: Ints, across_regions: bool) -> Ints:
    """Return the element that contains each point, by a walk from `start`.

    If the walk is blocked or too long, the search continues across interfaces, and then over all elements. For a point
    outside the mesh, an element near the point is returned.
    """
    found, inside = np.array(start, np.int32), np.empty(len(points), bool)
    elements, origin = tessellation.elements, (0.0,) * points.shape[1]
    if across_regions:
        elements = elements._replace(region=np.zeros_like(elements.region))

    def walk(thread: int, first: int, last: int) -> None:
        part = slice(first, last)
        walk_each(tessellation.position, elements, points[part], origin, found[part], inside[part])

    shared(walk, even_cuts(len(points), FEW))
    lost = np.flatnonzero(~inside)
    if len(lost) and not across_regions:
        found[lost] = walk_to_elements(tessellation, points[lost], found[lost], across_regions=True)
    elif len(lost):
        searched = Locator(tessellation).find(points[lost])
        found[lost] = np.where(searched >= 0, searched, found[lost])
    return found


def walk_in_parts(
    tessellation: AnyTessellation,
    points: Floats,
    start: Ints,
    nearest: Callable[[Any, Floats, Mask], Ints],
) -> Ints:
    """Return the element at each point, in the connected part of `start`.

    Parts may overlap, or touch without common nodes. `nearest` returns elements of a mask near points outside.
    """
    found, elements = walk_to_elements(tessellation, points, start, across_regions=False), tessellation.elements
    part = parts_of_regions(elements.neighbour, elements.region)[elements.region]
    astray = np.flatnonzero(part[found] != part[start])
    found[astray] = nearest_labelled(tessellation, points[astray], part, part[start[astray]], nearest)
    return found


def nearest_labelled(
    tessellation: AnyTessellation,
    points: Floats,
    labels: Ints,
    label: Ints,
    nearest: Callable[[Any, Floats, Mask], Ints],
) -> Ints:
    # of the elements with the label of every point
    found = np.empty(len(points), np.int64)
    for number in np.unique(label):
        rows = label == number
        found[rows] = nearest(tessellation, points[rows], labels == number)
    return found


def locator_of(mesh: Mesh) -> Locator:
    check_kind(mesh)
    kind = TESSELLATIONS[cell_of(mesh).dim]
    expect(*kind.groups)
    return Locator(kind.of(mesh))


def located(mesh: Mesh, x: ArrayLike) -> tuple[Int32s, Floats, Ints]:
    # elements of points, -1 outside, barycentric coordinates (d + 1, n) and nodes of the elements (d + 1, n)
    locator, points = locator_of(mesh), as_rows(x, dim=len(mesh.p))
    found = locator.find(points)
    if not is_second_order(mesh):
        return found, locator.barycentric_coordinates(points, found).T, locator.elements.node[found].T
    check_curved_sides(mesh)
    shape = Isoparametric(mesh)
    element, barycentric = shape.locate(points.T, found)
    return element.astype(np.int32), barycentric, shape.t[:, element]


def find_elements(mesh: Mesh, x: ArrayLike) -> Int32s:
    """Return the element that contains each point.

    Parameters
    ----------
    mesh
        A mesh of triangles or tetrahedra with straight or curved sides.
    x
        Points (2, n), or (3, n) in space, in mesh units.

    Returns
    -------
    ndarray (n,)
        Element indices, -1 outside the mesh. A point on an edge or a face has one of the adjacent elements. A point
        between a curved side and its chord has the element inside the curved side.

    Raises
    ------
    ValueError
        If `x` has the wrong shape, or if the mesh is invalid.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(2)
    >>> found = ka.find_elements(mesh, [[0.3, 2.0], [0.4, 0.0]])
    >>> (found >= 0).tolist()  # the second point is outside: -1
    [True, False]
    >>> ka.find_elements(skfem.MeshTet().refined(1), [[0.3], [0.4], [0.1]]).shape
    (1,)
    """
    return located(mesh, x)[0]


def elements_at(mesh: Mesh, x: Floats) -> Ints:
    # As `find_elements`, for few points on straight elements of a mesh that is known to be valid, without the grid.
    corners, margin = corner_positions(mesh), NEAR * width_of(mesh)
    element, point = BoxTree(corners.min(axis=1) - margin, corners.max(axis=1) + margin).boxes_around(x)
    around = corners[:, :, element]
    least = np.min(parts_at(around, x[:, point]) / cell_of(mesh).determinant(around), axis=0)
    found, order = np.full(x.shape[1], -1), np.argsort(least, kind="stable")
    order = order[least[order] >= -NEAR]
    found[point[order]] = element[order]
    return found


def interpolate(mesh: Mesh, values: ArrayLike, x: ArrayLike) -> Floats:
    """Return the values of a P1 function at points.

    Parameters
    ----------
    mesh
        A mesh of triangles or tetrahedra with straight or curved sides.
    values
        Values at the nodes (nnodes,), for curved sides at the corners.
    x
        Points (2, n), or (3, n) in space, in mesh units.

    Returns
    -------
    ndarray (n,)
        ``sum_k lambda_k(x) values[k]`` with the barycentric coordinates lambda of the element that contains x, for
        curved sides the coordinates in the reference element; nan outside the mesh.

    Raises
    ------
    ValueError
        If a shape is wrong, or if the mesh is invalid.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(2)
    >>> ka.interpolate(mesh, mesh.p[0] + mesh.p[1], [[0.3, 2.0], [0.4, 0.0]]).round(9).tolist()
    [0.7, nan]
    >>> solid = skfem.MeshTet().refined(1)
    >>> ka.interpolate(solid, solid.p.sum(axis=0), [[0.3], [0.4], [0.1]]).round(9).tolist()
    [0.8]
    """
    _, barycentric, nodes = located(mesh, x)
    values = np.asarray(values)
    if values.shape != (mesh.nvertices,):
        raise ValueError(f"values must have shape (nodes,) = ({mesh.nvertices},); got {values.shape}.")
    if values.dtype.kind not in "biuf":
        raise ValueError(f"values must be real numbers; got {values.dtype}. Interpolate the parts of complex ones.")
    return np.sum(barycentric * values[nodes], axis=0)


def as_rows(x: ArrayLike, name: str = "x", dim: int = 2) -> Floats:
    if np.iscomplexobj(x):
        raise ValueError(f"{name} must be real numbers; got complex ones.")
    points = np.asarray(x, np.float64)
    if points.ndim != 2 or points.shape[0] != dim:
        raise ValueError(f"{name} must have shape ({dim}, n); got {points.shape}.")
    return np.ascontiguousarray(points.T)
