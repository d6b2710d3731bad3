"""Recovery estimator of P1 solutions, by averages of the flux at nodes."""

import numpy as np
from numpy.typing import ArrayLike
from skfem import Mesh

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.estimators.discrete_flux import DiscreteFlux, discrete_flux
from kohonen_adapt.estimators.endless_layers import with_strong_corners
from kohonen_adapt.mesh.cells import TETRAHEDRON, cell_of
from kohonen_adapt.mesh.host import numbered, summed
from kohonen_adapt.mesh.measures import area
from kohonen_adapt.mesh.names import equal_and_connected

__all__ = ["corner_averages", "recovered_correction", "recovery", "regions_of"]


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
    discrete = discrete_flux(mesh, potential, reluctivity, source, flux)
    correction = recovered_correction(discrete, regions_of(discrete, region))
    indicators = np.sqrt(discrete.product(correction, correction))
    if cell_of(mesh) is TETRAHEDRON:
        return indicators
    return with_strong_corners(indicators, discrete)


def recovered_correction(discrete: DiscreteFlux, region: Ints) -> Floats:
    return corner_averages(discrete.space.mesh, discrete.at_corners, region) - discrete.at_corners


def corner_averages(mesh: Mesh, values: Floats, region: Ints) -> Floats:
    """Return averages of `values` at the corners of elements, weighted by ``|K|``.

    The average at a corner is over the elements around its node that lie in its own region, so that jumps between
    regions remain. `values` has shape (k, nelements), or (k, d + 1, nelements) if given per corner; the result has
    shape (k, d + 1, nelements).
    """
    pair = region * mesh.nvertices + mesh.t
    corner, size = numbered(pair.ravel()).reshape(pair.shape), area(mesh)
    weight = summed(corner, np.broadcast_to(size, corner.shape))
    totals = [summed(corner, np.broadcast_to(size * each, corner.shape)) for each in values]
    return np.stack([(total / weight)[corner] for total in totals])


def regions_of(discrete: DiscreteFlux, region: ArrayLike | None) -> Ints:
    """Return the number of the region of every element, see `recovery`."""
    count = discrete.source.shape
    data = np.vstack((discrete.reluctivity, discrete.prescribed.mean(axis=1))) if region is None else np.asarray(region)
    if region is not None and (data.shape != count or data.dtype.kind not in "iu"):
        raise ValueError(
            f"region must be integers of shape (nelements,) = {count}; got {data.dtype} of shape {data.shape}."
        )
    # A coefficient of every element, as of a nonlinear law, would give averages that are the fluxes themselves.
    mesh = discrete.space.mesh
    number = equal_and_connected(mesh, np.atleast_2d(data))
    size = np.bincount(number)
    alone = size[number] == 1
    if 2 * np.count_nonzero(alone) <= size.size:
        return number
    return equal_and_connected(mesh, np.where(alone, -1, number)[None])
