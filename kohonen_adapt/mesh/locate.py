"""Which element holds a point, and values of a solution at points."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.kernels.compilation import expect
from kohonen_adapt.kernels.threads import even_cuts, shared
from kohonen_adapt.kernels.triangle import locate as kernels
from kohonen_adapt.mesh.curved import check_bent, is_second_order
from kohonen_adapt.mesh.isoparametric import Isoparametric
from kohonen_adapt.mesh.triangulation import Triangulation

__all__ = ["Locator", "find_elements", "holding", "interpolate"]

FEW = 5_000  # points that are not worth another thread
CHUNK = 500_000  # points per compiled call, so that Ctrl-C is heard within half a second


class Locator:
    """Finds the element of any number of points in one triangulation as it is now.

    A regular grid of about as many cells as elements knows a nearby element for every point; from there it is a walk
    of a few steps. Where a hole or an outline blocks the walk, all elements of the cell are tried, so the answer is
    exact on any domain.
    """

    def __init__(self, triangulation: Triangulation) -> None:
        elements = triangulation.elements
        self.position = triangulation.position.copy()
        self.elements = elements._replace(
            node=elements.node.copy(), neighbour=elements.neighbour.copy(), region=np.zeros_like(elements.region)
        )
        self._lay_grid()

    def _lay_grid(self) -> None:
        """List the elements that meet each cell; cells are as near to squares as their number allows."""
        self.origin = self.position.min(axis=0)
        extent = self.position.max(axis=0) - self.origin
        side = np.sqrt(extent.prod() / len(self.elements.node))
        columns, rows = (int(count) for count in np.clip(np.ceil(extent / side), 1, 4096))
        self.shape = (columns, rows)
        self.size = extent / np.array(self.shape)
        grid = (self.position, self.elements.node, self.origin, self.size, self.shape)
        self.start = np.empty(columns * rows + 1, dtype=np.int64)
        kernels.count_in_cells(*grid, self.start)
        self.content = np.empty(self.start[-1], dtype=np.int32)
        kernels.fill_cells(*grid, self.start, self.content)

    def find(self, points: Floats) -> NDArray[np.int32]:
        """Element of every point of an (n, 2) array, -1 for points outside the mesh or not finite."""
        found = np.empty(len(points), dtype=np.int32)
        grid = (self.origin, self.size, self.shape, self.start, self.content)
        for first in range(0, len(points), CHUNK):
            chunk = slice(first, first + CHUNK)
            kernels.find(self.position, self.elements, points[chunk], *grid, found[chunk])
        return found


def holding(triangulation: Triangulation, points: Floats, start: Ints, across_outlines: bool) -> NDArray[np.int32]:
    """The element that holds each point (n, 2), found by a walk from an element near it; where none does, one nearby.

    The walk stays in the region in which it starts, unless it goes `across_outlines`. Where it is blocked, or too long,
    it goes on across them; where that is of no use either, all elements are searched.
    """
    found, inside = np.array(start, dtype=np.int32), np.empty(len(points), dtype=np.bool_)
    elements = triangulation.elements
    if across_outlines:
        elements = elements._replace(region=np.zeros_like(elements.region))

    def walk(thread: int, first: int, last: int) -> None:
        part = slice(first, last)
        kernels.walk_each(triangulation.position, elements, points[part], found[part], inside[part])

    shared(walk, even_cuts(len(points), FEW))
    lost = np.flatnonzero(~inside)
    if len(lost) and not across_outlines:
        found[lost] = holding(triangulation, points[lost], found[lost], across_outlines=True)
    elif len(lost):
        searched = Locator(triangulation).find(points[lost])
        found[lost] = np.where(searched >= 0, searched, found[lost])
    return found


def find_elements(mesh: MeshTri, x: ArrayLike) -> NDArray[np.int32]:
    """Element that holds each point.

    Parameters
    ----------
    mesh
        A triangular mesh, straight or with bent sides.
    x
        Points, (2, n), in mesh units.

    Returns
    -------
    ndarray (n,)
        Element numbers; -1 outside the mesh. A point on an edge gets one of its two elements, one between a bent side
        and its chord the element that the bent side is of.

    Raises
    ------
    ValueError
        If `x` is not of shape (2, n), or the mesh is not valid.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(2)
    >>> found = ka.find_elements(mesh, [[0.3, 2.0], [0.4, 0.0]])
    >>> (found >= 0).tolist()  # the second point is outside: -1
    [True, False]
    """
    points = as_rows(x)
    found = Locator(Triangulation.of(mesh)).find(points)
    if not is_second_order(mesh):
        return found
    check_bent(mesh)
    return Isoparametric(mesh).located(points.T, found)[0].astype(np.int32)


def interpolate(mesh: MeshTri, values: ArrayLike, x: ArrayLike) -> Floats:
    """Values of a piecewise linear function at points, found by walking.

    Parameters
    ----------
    mesh
        A triangular mesh, straight or with bent sides.
    values
        (n_nodes,): values at the nodes, of a `skfem.MeshTri2` at its corners.
    x
        Points, (2, n), in mesh units.

    Returns
    -------
    ndarray (n,)
        ``sum_k lambda_k(x) values[k]`` with the barycentric coordinates lambda of the element that holds x, with bent
        sides those of the reference element; nan outside the mesh.

    Raises
    ------
    ValueError
        If a shape does not fit, or the mesh is not valid.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(2)
    >>> ka.interpolate(mesh, mesh.p[0] + mesh.p[1], [[0.3, 2.0], [0.4, 0.0]]).round(9).tolist()
    [0.7, nan]
    """
    triangulation = Triangulation.of(mesh)
    values = np.asarray(values)
    if values.shape != (triangulation.nnodes,):
        raise ValueError(f"values must have shape (nodes,) = ({triangulation.nnodes},); got {values.shape}.")
    if values.dtype.kind not in "biuf":
        raise ValueError(f"values must be real numbers; got {values.dtype}. Interpolate the parts of complex ones.")
    expect("locating", "carrying")
    locator, points = Locator(triangulation), as_rows(x)
    found = locator.find(points)
    if is_second_order(mesh):
        check_bent(mesh)
        shape = Isoparametric(mesh)
        element, share = shape.located(points.T, found)
        return np.sum(share * values[shape.t[:, element]], axis=0)
    weights = np.empty((len(points), 3))
    kernels.barycentric(locator.position, locator.elements.node, points, found, weights)
    return np.sum(weights * values[locator.elements.node[found]], axis=1)


def as_rows(x: ArrayLike, name: str = "x") -> Floats:
    """Points of shape (2, n) as an (n, 2) array of the kernels."""
    if np.iscomplexobj(x):
        raise ValueError(f"{name} must be real numbers; got complex ones.")
    points = np.asarray(x, dtype=np.float64)
    if points.ndim != 2 or points.shape[0] != 2:
        raise ValueError(f"{name} must have shape (2, n); got {points.shape}.")
    return np.ascontiguousarray(points.T)
