"""Average over the elements around a node, region by region; estimate errors by the distance from the averages."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import MeshTri

from kohonen_adapt.arrays import Floats, Ints
from kohonen_adapt.estimators.inputs import DiscreteFlux, discrete_flux
from kohonen_adapt.mesh.measures import area, hat_gradients

__all__ = ["corner_averages", "linear_between", "recovery"]


def recovery(
    mesh: MeshTri,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    *,
    source: ArrayLike | None = None,
    flux: ArrayLike | None = None,
    region: ArrayLike | None = None,
) -> Floats:
    """Recovery indicators of a P1 solution of ``-div(nu grad u - flux) = source``.

    ``eta_K^2 = int_K |q* - q|^2 / nu_K`` with ``q = nu grad u - flux`` and q* the P1 field of its area-weighted
    averages at the nodes (Zienkiewicz and Zhu, Int. J. Numer. Meth. Eng. 24, 1987), taken separately over each region:
    connected elements of equal reluctivity and flux. Averages across materials would smear the true jump at the
    interface and overrate the error there, without bound as the ratio of the materials grows.

    Parameters
    ----------
    mesh
        A plain triangular mesh.
    potential : (nnodes,)
        Nodal values of the solution u.
    reluctivity : (nelements,)
        The coefficient nu > 0.
    source : (nelements,), optional
        Right-hand side; checked, though the averages do not need it.
    flux : (2, nelements), optional
        Prescribed flux, for magnets ``nu (-Br_y, Br_x)``; None is zero.
    region : (nelements,) of integers, optional
        What regions are told by, in place of reluctivity and flux: the number of the material, where these change
        inside one (saturated iron, radial magnets).

    Returns
    -------
    ndarray (nelements,)
        Indicators of the energy norm ``sqrt(int nu |grad e|^2)``, unsquared, in its unit. Zero in a region of a single
        element, which has nothing to be compared with.

    Raises
    ------
    ValueError
        For arguments of the wrong shape, not finite or not positive, and for a mesh that is broken or not a plain
        `MeshTri`.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.zeros(9)
    >>> u[mesh.interior_nodes()] = 1 / 16  # solves -div grad u = 1 with u = 0 on the rim
    >>> eta = ka.estimators.recovery(mesh, u, np.ones(8), source=np.ones(8))
    >>> eta.shape
    (8,)
    >>> bool(ka.estimators.recovery(mesh, mesh.p[0], np.ones(8)).max() < 1e-12)  # a solution without error
    True
    """
    discrete = discrete_flux(mesh, potential, reluctivity, source, flux)
    averages = corner_averages(mesh, discrete.values, _regions(mesh, _data(discrete, region)))
    squared = np.zeros(mesh.t.shape[1])
    for average, component in zip(averages, discrete.values, strict=True):
        difference = average - component
        squared += np.sum(difference**2, axis=0) + np.sum(difference, axis=0) ** 2
    return np.sqrt(discrete.area / 12.0 * squared / discrete.reluctivity)


def corner_averages(mesh: MeshTri, values: Floats, region: Ints) -> Floats:
    """Area-weighted averages of values per element (k, nelements) at the corners of the elements, (k, 3, nelements).

    A corner takes the elements around its node that are of its own region, so that jumps between regions stay jumps.
    """
    pair = region * mesh.p.shape[1] + mesh.t
    corner, size = np.unique(pair, return_inverse=True)[1].reshape(pair.shape), area(mesh)
    weight = np.bincount(corner.ravel(), np.tile(size, 3))
    totals = [np.bincount(corner.ravel(), np.tile(size * component, 3)) for component in values]
    return np.stack([(total / weight)[corner] for total in totals])


def linear_between(mesh: MeshTri, corners: Floats, x: Floats, element: Ints) -> Floats:
    """Values at points x (2, n) of these elements, linear between corner values (k, 3, nelements)."""
    offset = x - mesh.p[:, mesh.t[:, element]].mean(axis=1)
    share = 1.0 / 3.0 + np.einsum("cin,cn->in", hat_gradients(mesh)[:, :, element], offset)
    return np.einsum("kin,in->kn", corners[:, :, element], share)


def _data(discrete: DiscreteFlux, region: ArrayLike | None) -> NDArray[Any]:
    """Data that are equal inside a region, a column for each element."""
    if region is None:
        return np.vstack((discrete.reluctivity, discrete.prescribed))
    number = np.asarray(region)
    if number.shape != discrete.area.shape or number.dtype.kind not in "iu":
        raise ValueError(
            f"region must be integers of shape (nelements,) = {discrete.area.shape}; "
            f"got {number.dtype} of shape {number.shape}."
        )
    return number[None]


def _regions(mesh: MeshTri, data: NDArray[Any]) -> Ints:
    """Number of the region of every element: connected across facets, of equal data."""
    nelements = mesh.t.shape[1]
    one, other = mesh.f2t[:, mesh.f2t[1] >= 0]
    same = np.all(data[:, one] == data[:, other], axis=0)
    ones = np.ones(np.count_nonzero(same), dtype=np.int8)
    graph = coo_array((ones, (one[same], other[same])), shape=(nelements, nelements))
    return connected_components(graph, directed=False)[1].astype(np.int64)
