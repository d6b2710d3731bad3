"""Duality gap: the guaranteed bound for nonlinear material, of the energy above its minimum."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from skfem import ElementTriP1, MeshTri
from skfem.quadrature import get_quadrature

from kohonen_adapt.arrays import Floats
from kohonen_adapt.checks import finite_reals
from kohonen_adapt.mesh.measures import area, gradient
from kohonen_adapt.mesh.validity import check_mesh

__all__ = ["duality_gap"]


DEGREE = 4  # of the quadrature: exact for linear material


def duality_gap(
    mesh: MeshTri,
    potential: ArrayLike,
    field: ArrayLike,
    energy: Callable[[Floats], Floats],
    coenergy: Callable[[Floats], Floats],
    *,
    flux: ArrayLike | None = None,
) -> Floats:
    """Indicators whose sum of squares bounds twice the height of a P1 function's energy above the minimum.

    For ``min int W(|grad u|) - flux . grad u - source u`` with W convex, and a flux sigma* in equilibrium
    (`equilibrated_flux`), at every function u_h with the given values

        J(u_h) - J(u) <= sum_K int_K W(|grad u_h|) + W*(|s|) - grad u_h . s,    s = sigma* + flux,

    by Fenchel's inequality (Repin, Math. Comp. 69, 2000), where ``W*(h) = max_b (b h - W(b))``. In magnetostatics W is
    the energy density int H dB of a material without its magnet, W* its co-energy density int B dH, and s the field
    ``H* + Hc``. For linear material, ``W = nu b^2 / 2`` and ``W* = h^2 / (2 nu)``, these are the equilibrated
    indicators. The integral of W* is taken by a quadrature of degree 4: for other material the bound holds up to that.

    Parameters
    ----------
    mesh
        A plain triangular mesh.
    potential : (nnodes,)
        Nodal values of u_h; between them and the solution of the discrete equations no difference is made.
    field : (2, 3, nelements)
        The flux sigma* at the corners of the elements, what `equilibrated_flux` returns for the reluctivity at u_h.
    energy
        W: takes |grad u_h| >= 0 of all elements, (1, nelements), and returns as many densities.
    coenergy
        W*: takes |s| >= 0 at quadrature points of all elements, (npoints, nelements), and returns as many densities.
    flux : (2, nelements), optional
        Prescribed flux, for magnets ``Hc`` turned: ``(-Hc_y, Hc_x)``; None is zero.

    Returns
    -------
    ndarray (nelements,)
        ``sqrt(2 gap_K)``, unsquared indicators in the unit of the energy norm.

    Raises
    ------
    ValueError
        For arguments of the wrong shape or not finite, densities that are not finite or of the wrong shape, and a mesh
        that is broken or not a plain `MeshTri`.

    Examples
    --------
    >>> import numpy as np, skfem, kohonen_adapt as ka
    >>> mesh = skfem.MeshTri().refined(1)  # 9 nodes, one of them inside
    >>> u = np.zeros(9)
    >>> u[mesh.interior_nodes()] = 1 / 16  # solves -div grad u = 1 with u = 0 on the rim
    >>> given = (mesh, u, np.ones(8))
    >>> flux = ka.estimators.equilibrated_flux(*given, source=np.ones(8))
    >>> eta = ka.estimators.duality_gap(mesh, u, flux, lambda b: b**2 / 2, lambda h: h**2 / 2)
    >>> np.allclose(eta, ka.estimators.equilibrated(*given, source=np.ones(8)))  # of linear material
    True
    """
    check_mesh(mesh)
    nnodes, nelements = mesh.p.shape[1], mesh.t.shape[1]
    nodal = finite_reals("potential", potential, {"nnodes": nnodes}, "node")
    corners = finite_reals("field", field, {"2": 2, "3": 3, "nelements": nelements}, "element")
    empty = np.zeros((2, nelements)) if flux is None else flux
    prescribed = finite_reals("flux", empty, {"2": 2, "nelements": nelements}, "element")
    slope = gradient(mesh, nodal)
    (x, y), weights = get_quadrature(ElementTriP1, DEGREE)
    at_points = np.einsum("cik,iq->cqk", corners + prescribed[:, None], np.stack((1.0 - x - y, x, y)))
    size = np.linalg.norm(at_points, axis=0)
    stored = _densities("energy", energy, np.linalg.norm(slope, axis=0)[None])
    gap = stored + _densities("coenergy", coenergy, size) - np.einsum("ck,cqk->qk", slope, at_points)
    # Fenchel's inequality holds at every point, but for rounding.
    return np.sqrt(2.0 * area(mesh) * np.maximum(2.0 * weights @ gap, 0.0))


def _densities(name: str, function: Callable[[Floats], Floats], values: Floats) -> Floats:
    densities = np.asarray(function(values))
    if densities.shape != values.shape or not np.all(np.isfinite(densities)):
        raise ValueError(
            f"{name} must return a finite density for each of the values it is given, of shape {values.shape}; "
            f"got shape {densities.shape} with {np.count_nonzero(~np.isfinite(densities))} not finite."
        )
    return densities
