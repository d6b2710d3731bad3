"""Residual and recovery estimators of P1 solutions and of linear fluxes.

Both use the discrete flux ``nu grad u - flux``. The residual estimator takes its jumps across facets, the recovery
estimator its distance to averages at the nodes.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import Mesh, MeshTet

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.estimators.discrete_flux import DiscreteFlux, discrete_flux
from kohonen_adapt.estimators.endless_layers import with_strong_corners
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of, check_kind
from kohonen_adapt.mesh.host import number_facets
from kohonen_adapt.mesh.measures import area, hat_gradients

__all__ = [
    "corner_averages",
    "linear_residual",
    "outflows",
    "recovered_correction",
    "recovery",
]


def mean_and_rest(mesh: Mesh, name: str, flux: ArrayLike | None) -> tuple[ArrayLike | None, Floats]:
    # A flux of shape (d, nelements) or None is returned as given, with a deviation of zero. The deviation has shape
    # (d, d + 1, nelements).
    check_kind(mesh, space=True)
    dim = cell_of(mesh).dim
    shape = {str(dim): dim, str(dim + 1): dim + 1, "nelements": mesh.t.shape[1]}
    if np.ndim(flux) != 3:  # type: ignore[arg-type]
        return flux, np.zeros(tuple(shape.values()))
    corners = finite_reals(name, flux, shape, "element")  # type: ignore[arg-type]
    mean = corners.mean(axis=1)
    return mean, corners - mean[:, None]


def linear_residual(
    mesh: Mesh,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    source: ArrayLike | None,
    flux: ArrayLike | None,
    joined: tuple[ArrayLike, ArrayLike, ArrayLike] | None,
) -> Floats:
    mean, rest = mean_and_rest(mesh, "flux", flux)
    discrete = discrete_flux(mesh, potential, reluctivity, source, mean)
    # h_K^d = |K|. If h_K were the longest edge, the source would count twice as much as the jumps.
    load = discrete.area ** (1.0 + 2.0 / len(discrete.hats)) * discrete.source**2 / discrete.reluctivity
    return np.sqrt(load + _jumps(mesh, discrete, rest, joined))


def _jumps(
    mesh: Mesh, discrete: DiscreteFlux, rest: Floats, joined: tuple[ArrayLike, ArrayLike, ArrayLike] | None
) -> Floats:
    """Return the facet part of eta_K^2, shape (nelements,).

    For a constant jump, h_F ||jump||_F^2 is the squared integral of the jump over F, times h_F / |F|. In the plane the
    last factor is one. If the flux varies inside elements, with deviation `rest` from its mean, the jump is taken at
    the centroid of F.
    """
    cell, nfacets, side = cell_of(mesh), mesh.facets.shape[1], mesh.t2f.ravel()
    at_sides = discrete.values[:, None] - np.stack([rest[:, corners].mean(axis=1) for corners in cell.facets], axis=1)
    inward, size = discrete.hats[:, cell.opposite], np.empty(nfacets)  # of length |F| / (d |K|)
    outflow = -cell.dim * discrete.area * np.einsum("cik,cik->ik", at_sides, inward)
    size[mesh.t2f] = cell.dim * discrete.area * np.linalg.norm(inward, axis=0)
    jump = np.bincount(side, outflow.ravel(), nfacets)
    outer = np.where(np.bincount(side, minlength=nfacets) < 2, jump, 0.0)
    jump -= outer
    largest = np.zeros(nfacets)
    np.maximum.at(largest, side, np.tile(discrete.reluctivity, cell.dim + 1))
    if joined is not None:
        one, other, sign = (np.asarray(each) for each in joined)
        jump[one] = outer[one] + sign * outer[other]
        jump[other] = sign * jump[one]
        largest[one] = largest[other] = np.maximum(largest[one], largest[other])
    squared = size ** (1.0 / (cell.dim - 1) - 1.0) * jump**2
    return 0.5 * np.sum((squared / largest)[mesh.t2f], axis=0)


def recovery(
    mesh: Mesh,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    *,
    source: ArrayLike | None = None,
    flux: ArrayLike | None = None,
    region: ArrayLike | None = None,
) -> Floats:
    """Return recovery error indicators of a P1 solution.

    For ``-div(nu grad u - flux) = source`` the indicator is ``eta_K^2 = int_K |q* - q|^2 / nu_K`` with
    ``q = nu grad u - flux``. The P1 field q* has at each node the average of q over the elements around the node,
    weighted by area or volume (Zienkiewicz and Zhu, Int. J. Numer. Meth. Eng. 24, 1987). Averages are taken separately
    in each region, a connected set of elements of equal reluctivity and flux. Averages across materials would smooth
    the true jump at an interface and overestimate the error there, without bound as the ratio of the materials grows.
    In the plane, at nodes around which materials give the solution an exponent below 0.45, the elements get the squared
    error that finer elements around the node would remove. Averages do not show it, because it spreads over the mesh.
    If most regions are single elements, as with a coefficient that varies from element to element, connected elements
    of this kind are one region.

    Parameters
    ----------
    mesh, potential, reluctivity, source, flux
        As in `residual` at order 1. A flux given at the corners requires `region`. The source counts only
        at nodes with small exponents.
    region : (nelements,) of integers, optional
        Index of the material of every element. Regions are then connected sets of elements with equal index. Give this
        where reluctivity or flux vary inside a material (saturated iron, radial magnets).

    Returns
    -------
    ndarray (nelements,)
        As in `residual`. Zero in a region of a single element, because its average is the flux itself, unless most
        regions are such.

    Raises
    ------
    ValueError
        As in `residual`.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.isin(np.arange(9), mesh.interior_nodes()) / 16  # solves -div grad u = 1 with u = 0 on the boundary
    >>> eta = ka.estimators.recovery(mesh, u, np.ones(8), source=np.ones(8))
    >>> eta.shape
    (8,)
    >>> bool(ka.estimators.recovery(mesh, mesh.p[0], np.ones(8)).max() < 1e-12)  # a solution without error
    True
    """
    discrete, correction, _ = recovered_correction(mesh, potential, reluctivity, source, flux, region)
    squared, dim = np.zeros(mesh.t.shape[1]), cell_of(mesh).dim
    for difference in correction:
        squared += np.sum(difference**2, axis=0) + np.sum(difference, axis=0) ** 2
    indicators = np.sqrt(discrete.area / ((dim + 1) * (dim + 2)) * squared / discrete.reluctivity)
    return (
        indicators
        if dim == TETRAHEDRON.dim
        else with_strong_corners(indicators, mesh, discrete, np.asarray(potential, dtype=float))
    )


def recovered_correction(
    mesh: Mesh,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    source: ArrayLike | None,
    flux: ArrayLike | None,
    region: ArrayLike | None,
) -> tuple[DiscreteFlux, Floats, Ints]:
    mean, rest = mean_and_rest(mesh, "flux", flux)
    discrete = discrete_flux(mesh, potential, reluctivity, source, mean)
    values, number = discrete.values[:, None] - rest, _regions(mesh, _data(discrete, region))
    return discrete, corner_averages(mesh, values, number) - values, number


def corner_averages(mesh: Mesh, values: Floats, region: Ints) -> Floats:
    """Return averages of `values` at the corners of elements, weighted by ``|K|``.

    The average at a corner is over the elements around its node that lie in its own region, so that jumps between
    regions remain. `values` has shape (k, nelements), or (k, d + 1, nelements) if given per corner; the result has
    shape (k, d + 1, nelements).
    """
    pair = region * mesh.p.shape[1] + mesh.t
    corner, size = np.unique(pair, return_inverse=True)[1].reshape(pair.shape), area(mesh)
    weight = np.bincount(corner.ravel(), np.tile(size, len(mesh.t)))
    totals = [np.bincount(corner.ravel(), np.broadcast_to(size * each, corner.shape).ravel()) for each in values]
    return np.stack([(total / weight)[corner] for total in totals])


def _data(discrete: DiscreteFlux, region: ArrayLike | None) -> NDArray[Any]:
    if region is None:
        return np.vstack((discrete.reluctivity, discrete.prescribed))
    number = np.asarray(region)
    if number.shape != discrete.area.shape or number.dtype.kind not in "iu":
        raise ValueError(
            f"region must be integers of shape (nelements,) = {discrete.area.shape}; "
            f"got {number.dtype} of shape {number.shape}."
        )
    return number[None]


def _regions(mesh: Mesh, data: NDArray[Any]) -> Ints:
    # A coefficient of every element, as of a nonlinear law, would give averages that are the fluxes themselves.
    number = _equal_and_connected(mesh, data)
    size = np.bincount(number)
    alone = size[number] == 1
    if 2 * np.count_nonzero(alone) <= size.size:
        return number
    return _equal_and_connected(mesh, np.where(alone, -1, number)[None])


def _equal_and_connected(mesh: Mesh, data: NDArray[Any]) -> Ints:
    nelements = mesh.t.shape[1]
    one, other = mesh.f2t[:, mesh.f2t[1] >= 0]
    same = np.all(data[:, one] == data[:, other], axis=0)
    ones = np.ones(np.count_nonzero(same), dtype=np.int8)
    graph = coo_array((ones, (one[same], other[same])), shape=(nelements, nelements))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def outflows(mesh: MeshTet, flux: Floats, volume: Floats, normals: Floats | None = None) -> tuple[Floats, Floats]:
    # The flux out of both elements at the corners of facets, (3, nfacets) in the order of `mesh.facets`, and the areas.
    # In curved elements `normals` are the gradients of barycentric coordinates at every corner, (4, 3, 4, nelements).
    number_facets(mesh)
    hats, nfacets = hat_gradients(mesh), mesh.facets.shape[1]
    total, size = np.zeros(3 * nfacets), np.empty(nfacets)
    for side, (corners, opposite) in enumerate(zip(TETRAHEDRON.facets, TETRAHEDRON.opposite, strict=True)):
        facet, length = mesh.t2f[side], np.linalg.norm(hats[:, opposite], axis=0)
        size[facet] = 3.0 * volume * length
        for corner in corners:
            normal = hats[:, opposite] if normals is None else normals[corner, :, opposite]
            length = length if normals is None else np.linalg.norm(normal, axis=0)
            out = -np.sum(flux[:, corner] * normal, axis=0) / length
            row = np.argmax(mesh.facets[:, facet] == mesh.t[corner], axis=0)
            total += np.bincount(row * nfacets + facet, out, total.size)
    return total.reshape(3, nfacets), size
