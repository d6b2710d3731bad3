"""Estimate errors by the residual: the load of each element and the jumps of the flux across its sides."""

import numpy as np
from numpy.typing import ArrayLike
from skfem import MeshTri

from kohonen_adapt.arrays import Floats
from kohonen_adapt.estimators.inputs import DiscreteFlux, discrete_flux

__all__ = ["ENDS", "OPPOSITE", "residual"]


# scikit-fem's sides of a triangle join these local nodes, and are opposite to these.
ENDS, OPPOSITE = [(0, 1), (1, 2), (0, 2)], [2, 0, 1]


def residual(
    mesh: MeshTri,
    potential: ArrayLike,
    reluctivity: ArrayLike,
    *,
    source: ArrayLike | None = None,
    flux: ArrayLike | None = None,
    joined: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
) -> Floats:
    """Residual indicators of a P1 solution of ``-div(nu grad u - flux) = source``.

    ``eta_K^2 = h_K^2 ||source||_K^2 / nu_K + 1/2 sum_F h_F ||[(nu grad u - flux) . n]||_F^2 / max(nu)`` over the
    interior facets F of K, with the larger reluctivity of the two elements at F; facets of the boundary add nothing.
    h_K is the square root of the area of K, h_F the length of F. With this weight the effectivity does not depend on
    the ratio of the materials (Bernardi and Verfuerth, Numer. Math. 85, 2000); with each element's own nu the estimate
    sends all nodes into the iron. In magnetostatics the jump is that of the tangential field strength H_t.

    Parameters
    ----------
    mesh
        A plain triangular mesh.
    potential : (nnodes,)
        Nodal values of the solution u.
    reluctivity : (nelements,)
        The coefficient nu > 0.
    source : (nelements,), optional
        Right-hand side; None is zero.
    flux : (2, nelements), optional
        Prescribed flux, for magnets ``nu (-Br_y, Br_x)``; None is zero.
    joined : (k,), (k,), (k,), optional
        Facets of the boundary, those that a periodic mesh goes on with beyond them, and the sign that u changes by, 1
        or -1: across these there is a jump, too.

    Returns
    -------
    ndarray (nelements,)
        Indicators of the energy norm ``sqrt(int nu |grad e|^2)``, unsquared, in its unit. The root of their sum of
        squares is 3.4 to 4.4 times the error.

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
    >>> eta = ka.estimators.residual(mesh, u, np.ones(8), source=np.ones(8))
    >>> eta.shape
    (8,)
    >>> bool(ka.estimators.residual(mesh, mesh.p[0], np.ones(8)).max() < 1e-12)  # a solution without error
    True
    """
    discrete = discrete_flux(mesh, potential, reluctivity, source, flux)
    # h_K^2 ||source||_K^2 with h_K^2 = |K|: with the longest edge for h_K, loads would count twice as much as jumps.
    load = discrete.area**2 * discrete.source**2 / discrete.reluctivity
    return np.sqrt(load + _jumps(mesh, discrete, joined))


def _jumps(mesh: MeshTri, discrete: DiscreteFlux, joined: tuple[ArrayLike, ArrayLike, ArrayLike] | None) -> Floats:
    """The facet part of eta_K^2; h_F ||jump||_F^2 is the square of the jump integrated over F, so no length appears."""
    nfacets = mesh.facets.shape[1]
    side = mesh.t2f.ravel()
    outflow = -2.0 * discrete.area * np.einsum("ck,cik->ik", discrete.values, discrete.hats[:, OPPOSITE])
    jump = np.bincount(side, outflow.ravel(), nfacets)
    outer = np.where(np.bincount(side, minlength=nfacets) < 2, jump, 0.0)
    jump -= outer
    largest = np.zeros(nfacets)
    np.maximum.at(largest, side, np.tile(discrete.reluctivity, 3))
    if joined is not None:
        one, other, sign = (np.asarray(each) for each in joined)
        jump[one] = outer[one] + sign * outer[other]
        jump[other] = sign * jump[one]
        largest[one] = largest[other] = np.maximum(largest[one], largest[other])
    return 0.5 * np.sum((jump**2 / largest)[mesh.t2f], axis=0)
