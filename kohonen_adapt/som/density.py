"""Densities of nodes from error indicators or element sizes, and at any point."""

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import DataFunction, Floats, FloatsPair
from kohonen_adapt.checks import as_reals
from kohonen_adapt.mesh.cells import cell_of
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.shapes import (
    are_round,
    density_and_shape,
    tensors_at_points,
    tensors_of_elements,
)
from kohonen_adapt.mesh.validity import check_mesh

__all__ = [
    "check_order_and_norm",
    "density_from_indicators",
    "density_from_sizes",
    "equidistributing",
    "parts_of",
    "per_element",
    "values_at",
    "without_zeros",
]

ZERO = 1e-6  # value to which zeros are raised, relative to the largest value
UTMOST = 1e100  # maximum ratio of densities for which logarithms, products and sums are finite
QUIET = 1e-3  # value to which smaller indicators are raised, relative to the median


def density_from_indicators(mesh: Mesh, indicators: ArrayLike, *, order: int = 1, norm: str = "energy") -> Floats:
    """Return the density of nodes for which all elements have the same error.

    Parameters
    ----------
    mesh
        Mesh of triangles or tetrahedra to which the indicators belong.
    indicators
        Error of every element in the energy norm, not squared, shape (nelements,). The estimates in scikit-fem's own
        examples are squared: take their root.
    order
        Degree p of the elements, 1 to 4.
    norm
        ``"energy"`` or ``"L2"``, the norm in which the error is to be small.

    Returns
    -------
    ndarray of shape (nelements,)
        Nodes per area (in space per volume), positive, scaled so that ``sum |K| rho_K`` is the number of nodes.

    Raises
    ------
    ValueError
        If the indicators have another shape, are negative or not finite, or if `order` or `norm` is unknown.

    Notes
    -----
    The error of an element is modelled as ``eta_K^2 ~ |K| h^(2p) |D^(p+1) u|^2``. In d dimensions, the sum over the
    mesh is minimal at a given number of nodes ``int h^-d`` if ``rho_K ~ (eta_K^2 / |K|^(1 + 2p/d))^(d / (d + q))``,
    with q = 2p for the energy norm and q = 2p + 2 for the L2 norm, because the L2 error is smaller by another factor h.
    For p = 1 this is ``eta_K / |K|`` and ``(eta_K / |K|)^(2/3)`` in the plane, and ``(eta_K^2 / |K|^(5/3))^(3/5)`` and
    the power 3/7 of the same base in space. At the optimum for the energy norm all indicators are equal
    (equidistribution).

    Indicators below a thousandth of their median are raised to this value, so that a small number does not empty a
    region. If all indicators are zero, the density is constant.

    Examples
    --------
    >>> import skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 8 triangles of one area, 9 nodes
    >>> density = ka.density_from_indicators(mesh, [1, 1, 1, 1, 1, 1, 1, 3])
    >>> round(float(density[7] / density[0]), 9), round(float(density.mean()), 9)
    (3.0, 9.0)

    Refine a mesh once to find out if indicators are squared. With P1 elements and a smooth solution, the root of the
    sum of their squares falls to a half, or to an eighth if the indicators are squared already.

    >>> import numpy as np
    >>> def total(mesh):
    ...     return np.linalg.norm(ka.estimators.recovery(mesh, mesh.p[0] ** 2, np.ones(mesh.nelements)))
    >>> bool(0.4 < total(mesh.refined(3)) / total(mesh.refined(2)) < 0.6)
    True
    """
    check_mesh(mesh)
    values = per_element(mesh.nelements, indicators, "indicators")
    check_order_and_norm(order, norm)
    return equidistributing(mesh, values, order, norm)


def check_order_and_norm(order: int, norm: str) -> None:
    if isinstance(order, bool) or order not in (1, 2, 3, 4):
        raise ValueError(f"order must be the degree of the elements, 1 to 4; got {order!r}.")
    if norm not in ("energy", "L2"):
        raise ValueError(f"norm must be 'energy' or 'L2'; got {norm!r}.")


def equidistributing(mesh: Mesh, values: Floats, order: int, norm: str) -> Floats:
    sizes = area(mesh)
    if not values.any():
        return np.full(len(values), mesh.nvertices / sizes.sum())
    values = np.ldexp(values, -np.frexp(values.max())[1])  # or the median of huge values overflows
    median = np.median(values) or np.median(values[values > 0])
    eta = np.maximum(values, QUIET * median) / values.max()
    d = cell_of(mesh).dim
    q = 2 * order if norm == "energy" else 2 * order + 2
    density = (eta**2 / (sizes / sizes.max()) ** (1 + 2 * order / d)) ** (d / (d + q))
    return density * (mesh.nvertices / np.sum(sizes * density))


def density_from_sizes(mesh: Mesh, sizes: ArrayLike) -> Floats:
    """Return the density of nodes of a mesh with the wanted edge lengths.

    Parameters
    ----------
    mesh
        Mesh of triangles or tetrahedra to which the sizes belong.
    sizes
        Wanted edge length at every element in mesh units, shape (nelements,), or a metric M, symmetric positive
        definite tensors of shape (nelements, d, d): an edge e has the wanted length if ``e' M e = 1``. The length h in
        all directions is the metric ``I / h^2``.

    Returns
    -------
    ndarray of shape (nelements,) or (nelements, d, d)
        ``2 / (sqrt(3) h^2)`` nodes per area, as equilateral triangles have: half a node per triangle, which has the
        area ``sqrt(3) h^2 / 4``. In space ``sqrt(2) / h^3`` nodes per volume, as the face-centred cubic lattice has: 4
        nodes in a cube with sides sqrt(2) h. Regular tetrahedra alone do not fill space. For a metric, density tensors
        D with ``sqrt(det D)`` nodes per area or volume: ``D = 2 / sqrt(3) M``, in space ``2^(1/3) M``.

    Raises
    ------
    ValueError
        If the sizes have another shape, are not positive and finite, or give a density that is not. If a tensor is not
        finite, not symmetric or not positive definite, or if its longest edge is more than 1e6 times its shortest.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)
    >>> ka.density_from_sizes(mesh, np.full(8, 0.1)).round(2)[0]  # equilateral triangles with edges of 0.1
    np.float64(115.47)
    >>> ka.density_from_sizes(skfem.MeshTet(), np.full(5, 0.1)).round(2)[0]
    np.float64(1414.21)
    >>> metric = np.tile(np.diag([1 / 0.1**2, 1 / 0.02**2]), (8, 1, 1))  # edges of 0.1 along x, of 0.02 along y
    >>> density = ka.density_from_sizes(mesh, metric)
    >>> density.shape, np.sqrt(np.linalg.det(density)).round(1)[0]
    ((8, 2, 2), np.float64(577.4))
    """
    check_mesh(mesh)
    cell = cell_of(mesh)
    if np.ndim(sizes) == 3:
        metric = tensors_of_elements(sizes, mesh.nelements, cell.dim, "sizes")
        return metric * cell.size_per_node ** (-2.0 / cell.dim)
    lengths = per_element(mesh.nelements, sizes, "sizes")
    if not np.all(lengths > 0):
        raise ValueError(f"sizes must be above zero; element {int(np.argmin(lengths))} has {lengths.min()}.")
    with np.errstate(all="ignore"):
        density = 1.0 / (cell.size_per_node * lengths**cell.dim)
    bad = np.flatnonzero(~(np.isfinite(density) & (density > 0)))
    if len(bad):
        raise ValueError(
            f"sizes must be edge lengths in mesh units; element {bad[0]} has {lengths[bad[0]]}, whose density is "
            f"{density[bad[0]]}."
        )
    return density


def per_element(count: int, values: ArrayLike, name: str) -> Floats:
    array = as_reals(name, values, {"nelements": count})
    bad = np.flatnonzero(~(np.isfinite(array) & (array >= 0)))
    if len(bad):
        raise ValueError(f"{name} must be finite and >= 0; element {bad[0]} has {array[bad[0]]}.")
    return array


def without_zeros(values: Floats, largest: float) -> Floats:
    with np.errstate(over="ignore"):
        return np.where(values == 0.0, ZERO, np.clip(values / largest, 1.0 / UTMOST, UTMOST))


def values_at(function: DataFunction, points: Floats) -> Floats:
    values = np.asarray(function(points.T.copy()))
    if values.shape != (len(points),):
        raise ValueError(f"a callable density must return shape (n,) = ({len(points)},); got {values.shape}.")
    values = as_reals("density", values, {"n": len(points)})
    bad = np.flatnonzero(~(np.isfinite(values) & (values >= 0)))
    if len(bad):
        where = tuple(points[bad[0]].tolist())
        raise ValueError(f"density must be finite and >= 0; at {where} it is {values[bad[0]]}.")
    return values


def parts_of(density: ArrayLike | DataFunction, centroids: Floats) -> tuple[ArrayLike | DataFunction, Floats | None]:
    # a density, and the shapes of the elements with `centroids` (m, d) if these are not all round
    count, dim = centroids.shape
    if not callable(density):
        if np.ndim(density) != 3:
            return density, None
        values, shapes = density_and_shape(tensors_of_elements(density, count, dim, "density"))
        return values, None if are_round(shapes) else shapes
    if np.ndim(density(centroids[:1].T.copy())) != 3:
        return density, None

    def split(x: Floats) -> FloatsPair:
        return density_and_shape(tensors_at_points(density(x), x.T))

    shapes = split(centroids.T.copy())[1]
    return lambda x: split(x)[0], None if are_round(shapes) else shapes
