"""Metric of a mesh from recovered derivatives and error indicators."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints, Mask
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.estimators.recovery_estimator import corner_averages
from kohonen_adapt.mesh.adjacency import connected_arrays
from kohonen_adapt.mesh.cells import cell_of, centroids_of, corner_positions
from kohonen_adapt.mesh.curved import corners_of
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.names import regions_of
from kohonen_adapt.mesh.shapes import determinants, eigenvectors, packed, unpacked
from kohonen_adapt.mesh.validity import check_mesh
from kohonen_adapt.som.density import check_order_and_norm, equidistributing, per_element
from kohonen_adapt.som.derivatives import highest_derivatives

__all__ = ["gain_of_shapes", "hessian_shapes", "indicators_of_shapes", "metric_from_hessian", "metric_of_shapes"]

# Ratio by which longer edges have the least error of the gradient on aligned elements of large ratio, by the model of
# `error_of_shapes` at order 1 to 4. The error of values has none.
STRETCH = {"energy": (1.37, 1.24, 1.17, 1.13), "L2": (1.0, 1.0, 1.0, 1.0)}
# Weight of the slopes of the interpolant in the error of the gradient. Without the term, elements that have the
# directions of an earlier metric promise a gain that no mesh then has.
MISFIT = 0.075
LARGEST_RATIO = 1e3
LONGEST = 0.5  # edge, relative to the extent of the mesh; longer elements would leave no nodes for the layers' ends
ROUNDS = 10  # of the bound of edges, whose size depends on the bound
ROUNDING = 1e-11  # least part that curvature has in the values of an element, relative to the largest value


def metric_from_hessian(
    mesh: Mesh, values: ArrayLike, indicators: ArrayLike | None = None, *, order: int = 1, norm: str = "energy"
) -> Floats:
    """Return the metric in which elements of the best mesh are regular.

    Parameters
    ----------
    mesh
        Mesh of triangles or tetrahedra. Of curved elements the straight ones between the corners count.
    values
        Values of a discrete solution at the vertices, shape (nvertices,).
    indicators
        Error of every element in the energy norm, not squared, shape (nelements,). They give the size of the elements,
        and the recovered derivatives the shape. Without indicators, both are from the derivatives.
    order
        Degree k of the elements of the solution, 1 to 4.
    norm
        ``"energy"`` or ``"L2"``, the norm in which the error is to be small.

    Returns
    -------
    ndarray of shape (nelements, d, d)
        Symmetric positive definite tensors M, scaled so that regular elements with ``e' M e = 1`` for all edge vectors
        e have as many nodes as `mesh`: these are ``2 / sqrt(3)`` (in space ``sqrt(2)``) times the integral of
        ``sqrt(det M)``. The ratio of the longest and the shortest edge is at most 1000.

    Raises
    ------
    ValueError
        If the mesh is not valid, if an array has another shape or is not finite, if an indicator is negative, or if
        `order` or `norm` is unknown.

    Notes
    -----
    The Hessian H is recovered by quadratic polynomials around every node, separately in every region, a connected set
    of elements of the same subdomains. At interfaces, the jump of the gradient is therefore no curvature. The tensor Q
    is H with absolute eigenvalues, averaged over the elements around, so that its eigenvalues differ little where
    directions vary, as at a corner or with noise.

    The error of the gradient on an element with the edges of the matrix C (``J J'`` of determinant 1, for the map J
    from the regular element) is modelled as ``eta^2 ~ |K| tr(Q C)^(k - 1) (tr(Q Q C) + c tr(C^-1) tr(Q C)^2)``, with
    the derivatives of the function and the slopes of its interpolant (compare Huang, J. Comput. Phys. 204, 2005;
    Formaggia and Perotto, Numer. Math. 94, 2003; Alauzet and Loseille, CAD 72, 2016). The shape of M is Q of
    determinant 1 for the L2 norm. In the energy norm, edges of the ratio r in Q have the ratio ``r min(r^(1/3), s)`` in
    M, with the optimum s of the model for large ratios, from 1.37 at order 1 to 1.13 at order 4. Long edges are at most
    half as long as the mesh in a metric of a constant ``M / Q``.

    The density is that of `density_from_indicators`, for indicators multiplied by the ratio of the errors of the new
    shapes and of the present shapes of the elements by this model. Without indicators, the model itself gives them,
    with ``Q = G^(1 / (k + 1))`` and ``G_ij = sum_a T_ai T_aj`` over the multi-indices a of order k, for the recovered
    derivatives T of order k + 1.

    Metrics are round where derivatives cannot be recovered: in regions with a single layer of elements, or where the
    values are linear.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(3)
    >>> metric = ka.metric_from_hessian(mesh, 2 * mesh.p[0] ** 2 + mesh.p[1] ** 2)
    >>> metric.shape, round(float((metric[0, 0, 0] / metric[0, 1, 1]) ** 0.5), 6)  # edges 2^(2/3) times longer in y
    ((128, 2, 2), 1.587401)
    """
    check_mesh(mesh)
    connected_arrays(mesh)  # raises if the mesh is tangled
    check_order_and_norm(order, norm)
    cell, straight = cell_of(mesh), corners_of(mesh)
    function = finite_reals("values", values, {"nvertices": straight.p.shape[1]}, "node")
    shapes = hessian_shapes(mesh, [function], order, norm)
    if indicators is None:
        curvature = curvatures(mesh, [function], order)
        error = np.sqrt(error_of_shapes(curvature, raised(unpacked(shapes), -1.0), order))
        eta = error * area(straight) ** (0.5 + order / cell.dim)
    else:
        eta = indicators_of_shapes(mesh, per_element(mesh.nelements, indicators, "indicators"), shapes, order, norm)
    return metric_of_shapes(mesh, shapes, equidistributing(straight, eta, order, norm))


def metric_of_shapes(mesh: Mesh, shapes: Floats, density: Floats) -> Floats:
    cell = cell_of(mesh)
    return unpacked(shapes) * (cell.size_per_node * density)[:, None, None] ** (2.0 / cell.dim)


def hessian_shapes(mesh: Mesh, functions: Sequence[Floats], order: int, norm: str = "energy") -> Floats:
    """Return shapes of elements for functions whose squared errors add up.

    Every function is given by its values at the vertices, (nvertices,). The rows are as in `mesh/shapes.py`.
    """
    # Second derivatives of values at vertices have less noise than derivatives of order k + 1, and errors on layers
    # with their shapes are smaller at order 2 and 3.
    return shapes_of(corners_of(mesh), curvatures(mesh, functions, 1), STRETCH[norm][order - 1])


def indicators_of_shapes(mesh: Mesh, indicators: Floats, shapes: Floats, order: int, norm: str = "energy") -> Floats:
    """Return the indicators of elements of the same sizes with other shapes."""
    metric = unpacked(shapes)
    curvature = unstretched(metric, STRETCH[norm][order - 1])
    new = error_of_shapes(curvature, mean_edges(mesh, raised(metric, -1.0)), order)
    old = error_of_shapes(curvature, mean_edges(mesh, edges_of(mesh)), order)
    return indicators * np.sqrt(new / old)


def gain_of_shapes(shapes: Floats, indicators: Floats, order: int, norm: str) -> float:
    """Return the error with these shapes over the error with round elements.

    Both are the least errors with a number of nodes. The `indicators` eta of elements with these shapes may be of any
    sizes. Where a density makes them equal, the error is ``(sum eta^p)^(1 / p)`` up to a factor, with
    ``p = 2 d / (2 k + d)``.
    """
    metric = unpacked(shapes)
    dim = metric.shape[1]
    curvature = unstretched(metric, STRETCH[norm][order - 1])
    regular = np.broadcast_to(np.eye(dim), metric.shape)
    smaller = error_of_shapes(curvature, raised(metric, -1.0), order) / error_of_shapes(curvature, regular, order)
    power = dim / (2.0 * (order + (norm == "L2")) + dim)
    largest = indicators.max()
    squares = (indicators / largest) ** 2 if largest > 0.0 else np.ones(len(indicators))
    return float((np.sum(squares**power) / np.sum((squares / smaller) ** power)) ** (0.5 / power))


def error_of_shapes(curvature: Floats, edges: Floats, order: int) -> Floats:
    scaled = curvature @ edges
    once, twice = np.trace(scaled, axis1=1, axis2=2), np.sum(curvature * np.swapaxes(scaled, 1, 2), axis=(1, 2))
    misfit = MISFIT * traces_of_inverses(edges) * once**2
    return (twice + misfit) * once ** (order - 1)


def traces_of_inverses(tensors: Floats) -> Floats:
    # of determinant 1: the first or second invariant
    trace = np.trace(tensors, axis1=1, axis2=2)
    if tensors.shape[1] == 2:
        return trace
    return np.asarray(0.5 * (trace**2 - np.sum(tensors**2, axis=(1, 2))))


def edges_of(mesh: Mesh) -> Floats:
    offset = offsets(mesh)
    return with_unit_determinant(np.swapaxes(offset, 1, 2) @ offset)


def mean_edges(mesh: Mesh, edges: Floats) -> Floats:
    # No mesh follows the shape of every element. Means scale with the mesh.
    whole = np.zeros(len(edges), np.int64)
    return with_unit_determinant(means_around(mesh, whole, edges, np.ones(len(edges), bool)))


def with_unit_determinant(tensors: Floats) -> Floats:
    return tensors / determinants(tensors)[:, None, None] ** (1.0 / tensors.shape[1])


def offsets(mesh: Mesh) -> Floats:
    corners = corner_positions(mesh)
    return np.ascontiguousarray((corners - corners.mean(axis=1, keepdims=True)).T)


def curvatures(mesh: Mesh, functions: Sequence[Floats], order: int) -> Floats:
    """Return the tensors Q of `metric_from_hessian`, zero if not recovered."""
    straight = corners_of(mesh)
    region = regions_of(straight).astype(np.int64)
    exponent = np.frexp(max(np.abs(values).max() for values in functions))[1]
    squares = np.zeros((mesh.nelements, mesh.dim(), mesh.dim()))
    for values in functions:
        scaled = np.ldexp(values, -exponent)
        derivatives, found = highest_derivatives(straight, region, scaled, order + 1)
        rows = derivatives.reshape(mesh.nelements, -1, derivatives.shape[-1])
        squares += np.swapaxes(rows, 1, 2) @ rows
    curvature = raised(squares, 1.0 / (order + 1))
    offset = offsets(straight)
    part = np.sum((offset @ curvature) * offset, axis=(1, 2))
    curvature[part ** (0.5 * (order + 1)) < ROUNDING] = 0.0
    return means_around(straight, region, curvature, found)


def means_around(mesh: Mesh, region: Ints, tensors: Floats, found: Mask) -> Floats:
    rows = np.concatenate([packed(tensors), found[:, None]], axis=1)
    *sums, weight = corner_averages(mesh, rows.T, region).mean(axis=1)
    return unpacked(np.transpose(sums) / np.where(weight > 0.0, weight, 1.0)[:, None])


def shapes_of(mesh: Mesh, curvature: Floats, stretch: float) -> Floats:
    values, vectors = eigenvectors(curvature)
    ratio = ratios_of_bounded_edges(mesh, np.maximum(values, 0.0))
    return packed(shapes_along(vectors, ratio * np.maximum(np.cbrt(ratio), stretch**-2)))


def unstretched(shapes: Floats, stretch: float) -> Floats:
    values, vectors = eigenvectors(shapes)
    ratio = values / values[:, -1:]
    return shapes_along(vectors, np.minimum(ratio**0.75, ratio * stretch**2))


def shapes_along(vectors: Floats, values: Floats) -> Floats:
    values = values / np.prod(values, axis=1, keepdims=True) ** (1.0 / values.shape[1])
    return (vectors * values[:, None]) @ np.swapaxes(vectors, 1, 2)


def ratios_of_bounded_edges(mesh: Mesh, values: Floats) -> Floats:
    # Eigenvalues relative to the largest, raised to the value at which edges are as long as the bound in a metric of as
    # many nodes as the mesh has. The metric depends on the bound in turn.
    sizes = area(mesh)
    dim, largest = values.shape[1], values[:, -1:]
    longest, count = LONGEST * extent(mesh, sizes), cell_of(mesh).size_per_node * mesh.nvertices
    bounded = np.repeat(largest, dim, axis=1)
    for _ in range(ROUNDS):
        scale = (sizes @ np.sqrt(np.prod(bounded, axis=1)) / count) ** (2.0 / dim)
        least = scale / longest**2 if longest > 0.0 else np.inf  # a single element has no extent
        bounded = np.maximum(values, np.minimum(least, largest))
    return np.where(largest > 0.0, np.maximum(bounded / np.where(largest > 0.0, largest, 1.0), LARGEST_RATIO**-2), 1.0)


def extent(mesh: Mesh, sizes: Floats) -> Floats:
    # length of a box with the same largest moment of inertia
    centroid = centroids_of(mesh)
    weight = sizes / sizes.sum()
    offset = centroid - (centroid @ weight)[:, None]
    return np.sqrt(12.0 * np.linalg.eigvalsh((weight * offset) @ offset.T)[-1])


def raised(tensors: Floats, exponent: float) -> Floats:
    values, vectors = eigenvectors(tensors)
    return (vectors * np.maximum(values, 0.0)[:, None] ** exponent) @ np.swapaxes(vectors, 1, 2)
